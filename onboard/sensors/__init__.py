"""What all sensor inputs share: their clocks, and their timeouts."""
