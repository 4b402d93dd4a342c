"""The scenario pack against a box from outside: one table and one number."""
