"""Fits many people: reads who they are, distributes the fits, writes tables and page, learns from the group."""
