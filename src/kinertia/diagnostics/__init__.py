"""Finds what is wrong with recordings, persons, models and results: one module per subject of checks."""
