"""What was measured: markers and loads, which foot is on which plate, and when."""
