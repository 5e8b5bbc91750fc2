"""Findings about OpenSim models: mass properties, geometry, and whether the model is of this person."""
