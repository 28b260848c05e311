"""The executables of the package, by name."""

from cassie_msgs.processes import entry_point

simulator = entry_point("cassie_sim.ros.simulator")
