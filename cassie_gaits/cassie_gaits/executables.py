"""The executables of the package, by name."""

from cassie_msgs.processes import entry_point

optimize_gaits = entry_point("cassie_gaits.ros.optimize_gaits")
check_gaits = entry_point("cassie_gaits.ros.check_gaits")
gait_optimizer = entry_point("cassie_gaits.ros.gait_optimizer")
plot_gaits = entry_point("cassie_gaits.ros.plot_gaits")
