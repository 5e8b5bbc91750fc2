"""Extends Kinertia: a laboratory's marker set, its own file format, and a rule of its own."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import kinertia

_HERE = Path(__file__).parent
MARKER_SET = _HERE / "example_lab.toml"
_SHORTEST_S = 0.5


def read(path: Path) -> kinertia.Recording:
    """Read a .gaitlab file: labels in the first line, then time (s) and x, y, z (mm, Y up) of each marker."""
    lines = path.read_text(encoding="utf-8").splitlines()
    labels = tuple(lines[0].split(",")[1:])
    table = np.array([line.split(",") for line in lines[1:]], dtype=float)
    positions = table[:, 1:].reshape(len(table), len(labels), 3) / 1000.0
    return kinertia.Recording(path.stem, kinertia.Markers(table[:, 0], labels, positions))


def duration(context: Any) -> Iterator[kinertia.Finding]:
    """Report X101 of recordings that this laboratory's protocol calls too short."""
    time = context.recording.markers.time
    lasts_s = float(time[-1] - time[0])
    if lasts_s < _SHORTEST_S:
        size = kinertia.Quantity(lasts_s, "s", limit=_SHORTEST_S)
        yield kinertia.finding("X101", kinertia.Where(trial=context.name), duration_s=size)


RULES = kinertia.RulePackage(_HERE / "catalogue.toml", {"X10": duration})
