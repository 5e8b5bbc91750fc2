"""Computes error bars of the estimate: covariances, curves, posterior draws, and evidence for errors."""
