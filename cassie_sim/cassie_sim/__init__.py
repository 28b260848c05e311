"""Cassie in MuJoCo: robot, drives, sensors, grounds and gantry."""
