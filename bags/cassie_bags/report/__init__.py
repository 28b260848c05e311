"""Results for readers: text, figures, strips of images, videos and pages."""
