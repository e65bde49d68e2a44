"""What a plan of poses and temperatures can see, what it costs, and which measurement is the best."""
