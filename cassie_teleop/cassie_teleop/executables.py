"""The executables of the package, by name."""

from cassie_msgs.processes import entry_point

rc_teleop = entry_point("cassie_teleop.ros.rc_teleop")
doctor = entry_point("cassie_teleop.ros.doctor")
cmd_vel = entry_point("cassie_teleop.ros.cmd_vel")
joystick = entry_point("cassie_teleop.ros.joystick")
keyboard_teleop = entry_point("cassie_teleop.ros.keyboard_teleop")
scripted_operator = entry_point("cassie_teleop.ros.scripted_operator")
web_console = entry_point("cassie_teleop.ros.web_console")
