"""Recordings that tests run on: measured ones where they are on this machine, and always synthetic ones.

Files are named as in `measured_data`; those under `synthetic/` are written by `c3d_lab`.
"""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import pytest

from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.samples import VARIABLE
from kinertia.model.marker_set import MarkerSet
from validation.measured_data import find

K = TypeVar("K")
V = TypeVar("V", str, tuple[str | None, ...])

SYNTHETIC = "synthetic/"
NEEDS_MEASURED = "need measured recordings"
REQUIRED = bool(os.environ.get("CI") and os.environ.get(VARIABLE))
"""Whether every recording that tests name has to be here: `.ci/run` states where they are."""


def is_here(names: str | Iterable[str | None]) -> bool:
    """Whether tests can read these files on this machine."""
    wanted = [names] if isinstance(names, str) else [name for name in names if name is not None]
    missing = [name for name in wanted if not name.startswith(SYNTHETIC) and find(name) is None]
    if missing and REQUIRED:
        raise FileNotFoundError(f"{missing[0]} is not in {os.environ[VARIABLE]}, where {VARIABLE} states that all are")
    return not missing


def here(recordings: Iterable[V]) -> list[V]:
    """Of these files, or tuples of files, those that are on this machine: parameters of a test."""
    return [names for names in recordings if is_here(names)]


def named_here(recordings: dict[K, V]) -> dict[K, V]:
    """The same of files by a name."""
    return {key: names for key, names in recordings.items() if is_here(names)}


def marker_set_for(labels: Sequence[str]) -> MarkerSet:
    """The preset that fits these labels, or the set of subject4's laboratory."""
    file = Path(__file__).parent / "subject4.toml"
    return read_marker_set(file) if "r_calc" in labels else choose_marker_set(labels)


def slow_beside(quick: Iterable[K], names: Iterable[K]) -> list[Any]:
    """Parameters of a test that takes long: of these names, all but the quick ones are slow."""
    return [name if name in quick else pytest.param(name, marks=pytest.mark.slow) for name in names]


WALKS = named_here(
    {
        "synthetic": ("synthetic/walk.trc", "synthetic/walk_grf.mot"),
        "synthetic c3d": ("synthetic/walk.c3d", None),
        "gait2354": ("gait2354/subject01_walk1.trc", "gait2354/subject01_walk1_grf.mot"),
        "rajagopal": ("rajagopal_walk/motion_capture_walk.trc", "rajagopal_walk/grf_walk.mot"),
        "plug-in gait a": ("pig_c3d/subject_a_walk.c3d", None),
        "plug-in gait b": ("pig_c3d/subject_b_walk.c3d", None),
    }
)
"""Markers and forces of sound walks, as the fixture `recording_of` takes them."""
QUICK_WALKS = ("synthetic c3d", "rajagopal", "plug-in gait b")
"""Each kind once: plates with and without corners, one or two steps on each, a foot that reaches beyond its plate."""
FITTED = named_here(
    {
        "synthetic": "synthetic/walk.trc",
        "gait2354": "gait2354/subject01_walk1.trc",
        "rajagopal": "rajagopal_walk/motion_capture_walk.trc",
        "pig_a": "pig_c3d/subject_a_walk.c3d",
        "pig_b": "pig_c3d/subject_b_walk.c3d",
    }
)
"""Markers of walks by the names that the fixture `fit_of` takes (`fit_with_model`: the first three)."""
RUNS = named_here(
    {
        "synthetic": ("synthetic/run.trc", "synthetic/run_grf.mot"),
        "rajagopal": ("field/rajagopal_run/motion_capture_run.trc", "field/rajagopal_run/grf_run.mot"),
        "hamner": ("field/hamner_run/subject02_running.trc", "field/hamner_run/subject02_running_grf.mot"),
    }
)
LONG_WALKS = named_here(
    {
        "synthetic": ("synthetic/long.trc", "synthetic/long_grf.mot"),
        "rajagopal": ("rajagopal_walk/motion_capture_walk.trc", "rajagopal_walk/grf_walk.mot"),
    }
)
"""More than a stride of them is measured."""
SQUATS = named_here(
    {
        "synthetic": ("synthetic/squats.trc", "synthetic/squats_grf.mot"),
        "subject4": ("subject4/squats1.trc", "subject4/squats1_grf.mot"),
    }
)
