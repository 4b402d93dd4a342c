"""What all studies share: their runs, settings, intervals and results."""
