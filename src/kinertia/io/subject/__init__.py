"""Reads and drafts subject files and the files that they name."""
