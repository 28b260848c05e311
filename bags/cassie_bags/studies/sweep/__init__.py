"""Sweeps: measure the robot over ranges of commands, pushes, grounds and delays."""
