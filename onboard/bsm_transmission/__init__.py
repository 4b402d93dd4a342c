"""The host vehicle's BSM: when it is sent and what it contains (SAE J2945/1)."""
