"""What several questions stand on: velocities by forces and by markers, plate contacts, distances in segments."""
