"""Set-points of the drives from what is wanted of the robot."""
