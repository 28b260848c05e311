"""What the robot can do, in figures: runs over ranges of commands, pushes, grounds and delays."""
