"""A run as tables and as a figure."""
