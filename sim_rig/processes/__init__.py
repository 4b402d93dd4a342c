"""Child processes of a live run: start, stop, gpsd, CPU and clock faults."""
