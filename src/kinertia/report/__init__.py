"""`report.html` and the notebook pictures: what a `Fit` looks like. Estimation knows nothing of this package."""
