"""Serves the page on the user's own machine: drop files on it, check them, fit, read the report."""
