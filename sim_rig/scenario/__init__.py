"""The scenario language: schema, faults, expectations, and each car's configuration."""
