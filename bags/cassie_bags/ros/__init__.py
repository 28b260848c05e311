"""Nodes around the cores of this package: only this folder imports rclpy."""
