"""Many runs: sweeps, tuning, learning, faults, return maps, and who computes them."""
