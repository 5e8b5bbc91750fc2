"""Solves the normal equations: bands over time, with a border of what does not move."""
