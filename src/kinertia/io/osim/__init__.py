"""OpenSim model files: read, edited in place, and written."""
