"""Estimates motion, body segment parameters and calibration together, maximum a posteriori."""
