"""Reports the ranges of motion that the user states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.settings import Subject


def stated_ranges(subject: Subject) -> Iterator[Finding]:
    """S411 of each joint whose range the subject file states."""
    for name, degrees in (subject.ranges_deg or {}).items():
        low, high = np.radians(degrees).tolist()
        yield finding("S411", Where(part=name), range_rad=Quantity((low, high), "rad"))
