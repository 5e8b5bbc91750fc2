"""Describes the body: segments, joints, markers and their places on a person, and mass properties."""
