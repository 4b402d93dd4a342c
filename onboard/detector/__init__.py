"""Cars found by a detector of the user's: from every side, where the own vision knows plates."""
