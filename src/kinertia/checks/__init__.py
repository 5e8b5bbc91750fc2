"""Can this recording, this model, this result be used? Findings and verdicts in words."""
