"""Writes pages: reports of fits, checks, plans and studies, each one self-contained file."""
