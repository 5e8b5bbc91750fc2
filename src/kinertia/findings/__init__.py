"""Findings: what was found, where, with its size, what follows and what to do; the catalogue of codes."""
