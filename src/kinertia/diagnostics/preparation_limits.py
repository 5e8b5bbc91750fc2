"""Limits of what preparation reports itself; a module of their own, since `limits` loads all checks and readers."""

from kinertia.findings.limit import Limit

CALIBRATED_M = Limit(0.03, "m")
"""By which calibration moves markers at most; preparation reports more."""
KNOWN_BODY_SD = Limit(3.0)
"""SDs from the prior that a stated segment, or a body built from measures, may be away."""
MODEL_MASS_SHARE = Limit(0.002)
"""By which a model's mass is scaled without a word."""
