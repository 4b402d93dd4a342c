"""Assignment of measurements to tracks."""
