"""One vehicle: its cores connected, its configuration, and its messages to frames and back."""
