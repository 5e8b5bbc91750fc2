"""Writes folders and archives of results, complete or not at all."""
