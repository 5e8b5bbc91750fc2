"""Finds where on a standing person's body the markers are, by geometry; labels give hints only."""
