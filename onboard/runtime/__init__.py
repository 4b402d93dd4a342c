"""The process around the daemon: systemd, garbage collection, output sinks."""
