"""Effect of each fault."""
