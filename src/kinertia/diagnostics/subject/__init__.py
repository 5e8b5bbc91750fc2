"""Findings about the subject and the session: mass, stature, static trial, trials that belong together."""
