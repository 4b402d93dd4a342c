"""The two ways to run a scenario: with real processes, and in virtual time."""
