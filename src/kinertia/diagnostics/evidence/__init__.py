"""Computes evidence for several questions: velocities from forces and markers, plate contacts, segment distances."""
