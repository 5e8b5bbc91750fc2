"""Holds what was measured: markers and loads, and which foot is on which plate when."""
