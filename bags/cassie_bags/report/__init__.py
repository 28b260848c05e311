"""Outcomes for people: text, figures, strips of images, videos and pages."""
