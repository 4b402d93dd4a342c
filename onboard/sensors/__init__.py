"""Common parts of all sensor inputs: clocks of devices, and timeouts."""
