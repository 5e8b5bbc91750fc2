"""Defines what is minimised: one cost term per file, each with its unknowns, its part of the cost and its result."""
