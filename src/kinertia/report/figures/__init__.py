"""Draws figures: plain data for plotly, drawn in reports and notebooks, and as files for papers."""
