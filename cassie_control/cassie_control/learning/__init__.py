"""Torques that are learned over repeated steps."""
