"""`onboard keys`: a certificate authority for tests and prototypes."""
