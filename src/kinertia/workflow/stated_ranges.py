"""Applies ranges of motion that the user states of a person whose joints move more, or less, than most."""

from __future__ import annotations

import difflib
from dataclasses import replace

import numpy as np

from kinertia.errors import SettingsError
from kinertia.model.coordinate_range import UNKNOWN, Range
from kinertia.model.skeleton import Skeleton
from kinertia.settings import Subject


def with_stated_ranges(skeleton: Skeleton, subject: Subject) -> Skeleton:
    """The skeleton with the ranges that the subject file states in place of its own; what was clamped stays so.

    Raises:
        SettingsError: the model has no such coordinate.
    """
    ranges = dict(skeleton.ranges)
    for name, degrees in (subject.ranges_deg or {}).items():
        if name not in skeleton.coordinates:
            near = difflib.get_close_matches(name, skeleton.coordinates, n=1) or skeleton.coordinates[6:7]
            raise SettingsError(f"ranges_deg under [subject]: no coordinate {name} moves; there is {near[0]}")
        low, high = np.radians(degrees).tolist()
        ranges[name] = Range(low, high, ranges.get(name, UNKNOWN).clamped, stated=True)
    return replace(skeleton, ranges=ranges)
