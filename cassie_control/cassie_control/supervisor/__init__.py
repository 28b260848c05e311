"""Mode supervision: which mode the robot may be in, and with which set-points."""
