"""Cut the measured walk that the package brings along from the recordings it comes from.

    python benchmarks/cut_walk.py FOLDER

`FOLDER` holds `subject_a_static.c3d` and `subject_a_walk.c3d`, which are the static and the walking trial of
https://github.com/mitkof6/opensim_automated_pipeline. What is left: the markers, the channels of the force plates, and
the parameters that describe these, in the frames that `CUTS` names. Files are built anew from what is listed here, so
nothing else of the originals (model outputs, EMG, clinical records) gets into them. Numbers stay as they are, to the
last bit.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from kinertia.cli.measured_demo import FILES

MARKERS = (
    *("LFHD", "RFHD", "LBHD", "RBHD", "C7", "T10", "CLAV", "STRN", "RBAK"),
    *("LSHO", "LELB", "LWRA", "LWRB", "LFIN", "RSHO", "RELB", "RWRA", "RWRB", "RFIN"),
    *("LASI", "RASI", "LPSI", "RPSI", "LTHI", "LKNE", "LTIB", "LANK", "LHEE", "LTOE"),
    *("RTHI", "RKNE", "RTIB", "RANK", "RHEE", "RTOE"),
)
_COPIED = {
    "POINT": ("SCALE", "RATE", "X_SCREEN", "Y_SCREEN", "UNITS"),
    "ANALOG": ("GEN_SCALE", "RATE", "BITS", "FORMAT"),
    "FORCE_PLATFORM": ("USED", "ZERO", "TYPE", "CORNERS", "ORIGIN"),
    "TRIAL": ("CAMERA_RATE",),
    "MANUFACTURER": ("COMPANY", "SOFTWARE", "VERSION_LABEL"),
}
_BY_CHANNEL = ("GAIN", "SCALE", "OFFSET", "UNITS", "LABELS", "DESCRIPTIONS")
"""Parameters of ANALOG with an entry per channel."""


@dataclass(frozen=True)
class Cut:
    """Which frames of which file go where; frames count from the start of the capture, the last one is kept."""

    source: str
    target: str
    first: int
    last: int


CUTS = (
    Cut("subject_a_static.c3d", "static.c3d", 140, 159),
    Cut("subject_a_walk.c3d", "walk.c3d", 152, 515),
)
"""Of the static trial 20 frames from its middle. Of the walk all: the fit is of 2.76 to 3.58 s, where all ground
contact is measured, but calibration, smoothing and the search for ground contact use the steps around it, too. With
only 0.3 s on either side, body segment parameters move by up to 0.4 of their error bars; as it is, by 0.01, which is
the static trial's doing.
"""


def write_cut(cut: Cut, source: Path, target: Path) -> None:
    """Write the frames, markers and plate channels of one file to another.

    Args:
        cut: the frames; the names of its files are not looked at.
        source: the whole recording.
        target: is replaced.

    Raises:
        ValueError: the source does not have these frames or markers.
    """
    whole, part = ezc3d.c3d(str(source)), ezc3d.c3d()
    begin = whole["header"]["points"]["first_frame"]
    frames = slice(cut.first - begin, cut.last + 1 - begin)
    if frames.start < 0 or frames.stop > whole["data"]["points"].shape[2]:
        raise ValueError(f"{source} does not have all the frames from {cut.first} to {cut.last}")
    labels = [str(label).strip() for label in whole["parameters"]["POINT"]["LABELS"]["value"]]
    _copy_points(whole, part, [labels.index(name) for name in MARKERS], frames)
    _copy_analogs(whole, part, frames)
    part["header"]["points"]["first_frame"] = cut.first
    for group, names in _COPIED.items():
        for name in names:
            _copy(whole, part, group, name)
    for name, frame in (("ACTUAL_START_FIELD", cut.first + 1), ("ACTUAL_END_FIELD", cut.last + 1)):
        _copy(whole, part, "TRIAL", name)
        part["parameters"]["TRIAL"][name]["value"] = np.array([frame, 0])
    for name in whole["parameters"]["PROCESSING"]:
        if name != "__METADATA__" and (name == "Marker_filter_Processing" or _is_number(whole, name)):
            _copy(whole, part, "PROCESSING", name)
    part.write(str(target))


def _copy_points(whole: Any, part: Any, kept: list[int], frames: slice) -> None:
    part["data"]["points"] = whole["data"]["points"][:, kept, frames]
    metas = whole["data"]["meta_points"]
    part["data"]["meta_points"] = {name: values[:, kept, frames] for name, values in metas.items()}
    part["parameters"]["POINT"]["LABELS"]["value"] = list(MARKERS)
    part["parameters"]["POINT"]["DESCRIPTIONS"]["value"] = [""] * len(MARKERS)


def _copy_analogs(whole: Any, part: Any, frames: slice) -> None:
    """The channels of the plates, in the order in which the plates name them."""
    per_frame = whole["data"]["analogs"].shape[2] // whole["data"]["points"].shape[2]
    samples = slice(frames.start * per_frame, frames.stop * per_frame)
    channels = whole["parameters"]["FORCE_PLATFORM"]["CHANNEL"]["value"]
    kept = channels.T.ravel() - 1
    part["data"]["analogs"] = whole["data"]["analogs"][:, kept, samples]
    for name in _BY_CHANNEL:
        _copy(whole, part, "ANALOG", name)
        values = whole["parameters"]["ANALOG"][name]["value"]
        chosen = values[kept] if isinstance(values, np.ndarray) else [values[k] for k in kept]
        part["parameters"]["ANALOG"][name]["value"] = chosen
    _copy(whole, part, "FORCE_PLATFORM", "CHANNEL")
    part["parameters"]["FORCE_PLATFORM"]["CHANNEL"]["value"] = np.arange(1, len(kept) + 1).reshape(channels.T.shape).T


def _copy(whole: Any, part: Any, group: str, name: str) -> None:
    """One parameter with its type; a later change of its value leaves the whole recording alone."""
    part["parameters"].create_group_if_needed(group)
    part["parameters"][group][name] = dict(whole["parameters"][group][name])


def _is_number(whole: Any, name: str) -> bool:
    value = whole["parameters"]["PROCESSING"][name]["value"]
    return isinstance(value, np.ndarray) and value.size == 1


if __name__ == "__main__":
    for one in CUTS:
        write_cut(one, Path(sys.argv[1]) / one.source, FILES / one.target)
        print(f"{FILES / one.target}: {(FILES / one.target).stat().st_size} bytes")
