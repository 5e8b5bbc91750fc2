"""Findings about markers (M) and their labels (L): trajectories, frames, axes and floor, marker set, swapped labels."""
