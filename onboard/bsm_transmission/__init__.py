"""When this car sends a BSM, and what it says of itself in it (SAE J2945/1)."""
