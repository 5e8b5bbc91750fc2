"""Findings about markers: trajectories, frames, precision, axes and floor."""
