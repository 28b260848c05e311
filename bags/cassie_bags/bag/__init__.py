"""Bags: written, read, repaired, and as arrays. Knows no experiment and no physics."""
