"""Signals and metrics of a recording: tracking, walking, standing, riding, falls."""
