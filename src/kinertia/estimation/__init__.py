"""Estimates body segment parameters from recordings: preparation, the two estimators, and the result."""
