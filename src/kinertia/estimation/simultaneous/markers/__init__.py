"""Describes errors of markers: noise, skin motion, offsets, and which markers are visible."""
