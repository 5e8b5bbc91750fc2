"""Findings about time: sampling rates and synchronisation of forces and markers."""
