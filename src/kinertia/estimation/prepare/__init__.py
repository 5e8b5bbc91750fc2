"""Prepares what an estimator needs of a person: checked input, calibrated model."""
