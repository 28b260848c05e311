"""Fail-safes: what can go wrong around the robot, what it then does, and how one goes on."""
