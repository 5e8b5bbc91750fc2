"""The body: segments, joints, markers and their place on a person, and its mass properties."""
