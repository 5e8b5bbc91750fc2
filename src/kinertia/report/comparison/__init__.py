"""Compares results: two sessions or conditions, several results, and results with what files contain."""
