"""Coordinates from markers, their derivatives, and rigid-body dynamics of given motion."""
