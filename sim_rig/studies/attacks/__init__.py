"""What insiders and eavesdroppers gain."""
