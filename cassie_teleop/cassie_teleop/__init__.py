"""Driving Cassie by radio, gamepad, keyboard or script."""
