"""A stand-in for the two-level estimate, where a test is about everything around it."""

from kinertia.estimation.two_level import TwoLevelResult, correct_pelvis


def given_back(skeleton, start, windows, symmetric=True, progress=None):
    """In place of the two-level estimate: its start, without the seconds of iterating."""
    return TwoLevelResult(start, tuple(correct_pelvis(skeleton, start, w) for w in windows), (), (0.0, 0.0), 1, True)
