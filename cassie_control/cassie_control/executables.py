"""The executables of the package, by name."""

from cassie_msgs.processes import entry_point

state_estimator = entry_point("cassie_control.ros.state_estimator")
gait_controller = entry_point("cassie_control.ros.gait_controller")
mode_supervisor = entry_point("cassie_control.ros.mode_supervisor")
stack = entry_point("cassie_control.ros.stack")
