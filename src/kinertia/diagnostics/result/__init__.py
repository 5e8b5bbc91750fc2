"""Findings about estimates: residuals, parameters, instruments as the estimate sees them."""
