"""Computes evidence for several checks: velocities from forces and markers, plate contacts, segment distances."""
