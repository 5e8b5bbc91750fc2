"""Holds the result of an estimate, and what is derived from it: curves, cycles, scores, draws."""
