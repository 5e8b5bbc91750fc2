"""Findings about force plates (P) and timing (T): signals, zeros, gains, directions, positions, contact, delays."""
