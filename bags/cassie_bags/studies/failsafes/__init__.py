"""Fail-safes: what can go wrong around the robot, what the robot does, and how to go on."""
