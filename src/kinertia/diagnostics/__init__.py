"""Finds what is wrong with recordings, persons, models and results: one module per check."""
