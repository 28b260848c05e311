"""Results for readers: text, pictures, strips of images, videos and pages."""
