"""Where on the body the markers of a standing person are, by geometry; what they are called gives hints only."""
