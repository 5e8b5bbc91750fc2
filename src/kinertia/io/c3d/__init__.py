"""Reads and writes C3D files, through ezc3d: markers, plates, events, the subject, model outputs."""
