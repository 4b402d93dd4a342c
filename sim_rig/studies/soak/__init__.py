"""Load and endurance of real daemons."""
