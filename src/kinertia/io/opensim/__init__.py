"""Reads, edits in place, and writes OpenSim model files."""
