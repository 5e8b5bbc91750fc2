"""Reads the recordings that a subject file names."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from kinertia.errors import SettingsError
from kinertia.estimation.prepare import Prepared, Progress, TrialInput, prepare
from kinertia.estimation.prepare_osim import prepare_osim
from kinertia.io.osim.reader import read_osim
from kinertia.io.recording import read_recording
from kinertia.model.marker_set import MarkerSet, read_marker_set
from kinertia.settings import SubjectFile
from kinertia.trial.data import Recording


def read_inputs(
    wanted: SubjectFile, progress: Progress = lambda stage, share: None
) -> tuple[Recording, list[TrialInput], MarkerSet | None]:
    """The static trial, the gait trials by their names in the subject file, and the marker set if it names one.

    Raises:
        KinertiaError: a file is missing or broken.
    """
    static = read_recording(_static(wanted))
    marker_set = None if wanted.model.markers is None else read_marker_set(wanted.model.markers)
    return static, read_trials(wanted, progress), marker_set


def read_prepared(wanted: SubjectFile, progress: Progress = lambda stage, share: None) -> Prepared:
    """All that an estimator needs of the person: everything read, calibrated, solved and smoothed.

    Raises:
        KinertiaError: a file is missing or broken, or something in it cannot be used.
    """
    if wanted.model.osim is not None:
        model, trials = read_osim(wanted.model.osim), read_trials(wanted, progress)
        return prepare_osim(wanted.subject, model, trials, wanted.settings, wanted.model.calibrate, progress)
    static, inputs, marker_set = read_inputs(wanted, progress)
    return prepare(wanted.subject, static, inputs, wanted.settings, marker_set, progress)


def _static(wanted: SubjectFile) -> Path:
    if wanted.model.static is None:
        raise SettingsError("[model] names an OpenSim model; this needs a static trial (static = ...)")
    return wanted.model.static


def read_trials(wanted: SubjectFile, progress: Progress = lambda stage, share: None) -> list[TrialInput]:
    """The trials by their names in the subject file.

    Columns of the same name in the force files of two trials need not come from the same plate (laboratories sort steps
    into such files), so each trial's are plates of their own; the plates of C3D files are those of the laboratory.

    Raises:
        KinertiaError: a file is missing or broken.
    """
    inputs = []
    for k, files in enumerate(wanted.trials):
        progress("reading", k / len(wanted.trials))
        started = time.perf_counter()
        recording = read_recording(files.markers, files.forces, files.loads)
        seconds = time.perf_counter() - started
        plates = recording.plates
        if plates is not None and files.forces is not None and len(wanted.trials) > 1:
            plates = replace(plates, names=tuple(f"{name} ({files.name})" for name in plates.names))
        inputs.append(TrialInput(replace(recording, name=files.name, plates=plates), files.window_s, seconds))
    return inputs
