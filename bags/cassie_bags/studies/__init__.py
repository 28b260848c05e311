"""Studies of many runs: sweeps, tuning, learning, faults, return maps; and their processes."""
