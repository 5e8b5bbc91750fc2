"""Findings about force plates: signals, zeros, gains, directions, centres of pressure, contact."""
