"""What runs in the car: cores without I/O, thin edges, and the daemon that joins them."""
