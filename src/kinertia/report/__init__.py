"""Presents a `Fit`: `report.html`, figures, notebook pictures. Estimation does not depend on this package."""
