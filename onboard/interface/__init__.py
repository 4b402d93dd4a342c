"""The live interface: events out and requests in, as JSON lines for programs on this computer."""
