"""Motion, body segment parameters and calibration in one maximum-a-posteriori estimate."""
