"""State estimation from joint encoders and the IMU."""
