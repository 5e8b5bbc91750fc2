"""From recordings to body segment parameters: preparation, the two estimators, and the result."""
