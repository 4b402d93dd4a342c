"""Platoons: the LCCA paper's chain collisions, membership, and identities."""
