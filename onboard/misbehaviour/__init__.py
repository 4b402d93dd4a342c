"""Which messages count: checks of what a verified message claims, and charges to its signer."""
