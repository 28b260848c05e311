"""Control laws: set-points of the drives from the robot's state and the commanded mode."""
