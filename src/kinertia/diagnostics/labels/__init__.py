"""Findings about labels: left and right, front and back, swapped markers, rigid segments."""
