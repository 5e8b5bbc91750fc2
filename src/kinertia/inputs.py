"""Reads the recordings that a subject file names."""

from __future__ import annotations

import time
from dataclasses import replace

from kinertia.config import SubjectFile
from kinertia.io.recording import read_recording
from kinertia.marker_set import MarkerSet, read_marker_set
from kinertia.prepare import Progress, TrialInput
from kinertia.trial import Recording


def read_inputs(
    wanted: SubjectFile, progress: Progress = lambda stage, share: None
) -> tuple[Recording, list[TrialInput], MarkerSet | None]:
    """The static trial, the gait trials by their names in the subject file, and the marker set if it names one.

    Raises:
        KinertiaError: a file is missing or broken.
    """
    started = time.perf_counter()
    progress("reading", 0.0)
    static = read_recording(wanted.model.static)
    inputs = []
    for k, files in enumerate(wanted.trials):
        progress("reading", k / len(wanted.trials))
        recording = read_recording(files.markers, files.forces, files.loads)
        seconds = time.perf_counter() - started
        inputs.append(TrialInput(replace(recording, name=files.name), files.window_s, seconds))
        started = time.perf_counter()
    marker_set = None if wanted.model.markers is None else read_marker_set(wanted.model.markers)
    return static, inputs, marker_set
