"""Reads the recordings that a subject file names: static trial, motions, and marker set."""

import time
from collections.abc import Callable
from dataclasses import replace

from kinertia.errors import SettingsError
from kinertia.io.belt_file import read_belt
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.subject_tables import SubjectFile, TrialFiles
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording
from kinertia.trial.plate_loading import with_unloaded_levels
from kinertia.trial.plate_names import with_plates_of_trial
from kinertia.trial.trial_input import TrialInput

Progress = Callable[[str, float], None]


def read_inputs(
    wanted: SubjectFile, progress: Progress = lambda stage, share: None
) -> tuple[Recording, list[TrialInput], MarkerSet | None]:
    """Read the static trial, the gait trials by their names in the subject file, and its marker set if it states one.

    Raises:
        KinertiaError: a file is missing or broken.
    """
    static = read_static(wanted)
    marker_set = None if wanted.model.markers is None else read_marker_set(wanted.model.markers)
    trials = []
    for k, files in enumerate(wanted.trials):
        progress("reading", k / len(wanted.trials))
        trials.append(read_trial(wanted, files))
    return static, trials, marker_set


def read_static(wanted: SubjectFile) -> Recording:
    """Read the static trial of a subject file.

    Raises:
        KinertiaError: there is none, or its file is missing or broken.
    """
    if wanted.model.static is None:
        raise SettingsError.of_entry("[model]", "expected a static trial (static = ...), and no OpenSim model")
    return _as_zeroed(wanted, read_recording(wanted.model.static, length_unit=wanted.model.length_unit, standing=True))


def read_trial(wanted: SubjectFile, files: TrialFiles) -> TrialInput:
    """Read one of the trials of a subject file, by its name there.

    Columns of the same name in the force files of two trials need not come from the same plate (laboratories sort steps
    into such files), so each trial has plates of its own, unless the subject file states that they are the same; the
    plates of C3D files are the laboratory's.

    Raises:
        KinertiaError: a file is missing or broken.
    """
    started = time.perf_counter()
    recording = _as_zeroed(wanted, read_recording(files.markers, files.forces, files.loads, files.length_unit))
    seconds = time.perf_counter() - started
    recording = replace(recording, name=files.name, belt=read_belt(files.belt_speed_m_s))
    apart = files.forces is not None and len(wanted.trials) > 1 and not wanted.instruments.same_plates
    return TrialInput(with_plates_of_trial(recording) if apart else recording, files.window_s, seconds, files.use)


def _as_zeroed(wanted: SubjectFile, recording: Recording) -> Recording:
    """Restore the unloaded readings of plates in their loads, where the laboratory states that they were zeroed."""
    if not wanted.instruments.zeroed or recording.plates is None:
        return recording
    return replace(recording, plates=with_unloaded_levels(recording.plates))
