"""Fits one of two sessions that are to be compared: with joint axes and marker positions as uncertain as after putting
markers on anew."""

from dataclasses import replace
from pathlib import Path

from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.result import Fit
from kinertia.io.subject.reader import read_subject
from kinertia.workflow.estimate import estimate
from kinertia.workflow.from_files import prepare_subject

MARKER_SD_M = 0.010
"""Of marker positions in their segments: 5 mm each, and 5 mm that markers of a segment share. As independent errors, 10
mm leave the middle of three to five markers as uncertain as that; with 7 mm, intervals of hip and pelvis angles between
days held the truth of synthetic people in 69 to 85 %."""


def fit_session(subject: Path, progress: Progress = lambda stage, share: None) -> Fit:
    """Estimate a session from its subject file.

    Axes of knees, ankles and elbows of the built-in model are estimated where there is a static trial, unless the file
    settles `joint_axes`.

    Raises:
        KinertiaError: a file is missing or broken, or something in it cannot be used.
    """
    wanted = read_subject(subject)
    if wanted.settings.joint_axes is None and wanted.model.osim is None and wanted.model.static is not None:
        settings = wanted.settings.model_copy(update={"joint_axes": True})
        wanted = wanted.model_copy(update={"settings": settings})
    return estimate(with_markers_anew(prepare_subject(wanted, progress)), progress)


def with_markers_anew(ready: Prepared) -> Prepared:
    """Let marker positions be as uncertain as between two sessions."""
    known = ready.uncertainty
    if known.marker_sd_m is None:
        return ready
    return replace(ready, uncertainty=replace(known, marker_sd_m=max(known.marker_sd_m, MARKER_SD_M)))
