"""Nodes around the cores of this package: the one place that imports rclpy."""
