"""Up axis, yaw and category of a scan."""
