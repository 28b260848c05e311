"""Where and when the feet land."""
