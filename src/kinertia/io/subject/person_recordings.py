"""Reads the recordings that a subject file names: static trial, motions, and marker set."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from kinertia.errors import SettingsError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.subject.belt_file import read_belt
from kinertia.io.subject.tables import SubjectFile, TrialFiles
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording
from kinertia.trial.plate_loading import with_unloaded_levels
from kinertia.trial.plate_names import selected, with_plates_of_trial
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
    static = read_recording(wanted.model.static, length_unit=wanted.model.length_unit, standing=True)
    return _cut(_as_used(wanted, static), wanted.model.window_s)


def _cut(static: Recording, window_s: tuple[float, float] | None) -> Recording:
    """Return the part of the static trial in which the person stands.

    Raises:
        SettingsError: no frame is in it.
    """
    if window_s is None:
        return static
    markers = static.markers.cut(*window_s)
    if not len(markers.time):
        time = static.markers.time
        problem = f"the static trial has no frame in it: it goes from {time[0]:.2f} to {time[-1]:.2f} s"
        raise SettingsError.of_entry("[model] window_s", problem)
    plates = None if static.plates is None else static.plates.cut(*window_s)
    return replace(static, markers=markers, plates=plates if plates is not None and len(plates.time) else None)


def read_trial(wanted: SubjectFile, files: TrialFiles) -> TrialInput:
    """Read one of the trials of a subject file, by its name there.

    Columns of the same name in the force files of two trials need not come from the same plate (laboratories sort steps
    into such files), so each trial has plates of its own, unless the subject file states that they are the same; the
    plates of C3D files are the laboratory's.

    Raises:
        KinertiaError: a file is missing or broken.
    """
    started = time.perf_counter()
    read = read_recording(files.markers, files.forces, files.loads, files.length_unit)
    seconds = time.perf_counter() - started
    _expect_plates(read, wanted.instruments.plates or (), "[instruments] plates")
    recording = _as_used(wanted, read)
    _expect_plates(recording, [one.plate for one in files.feet], "[[trial]] feet")
    recording = replace(
        recording, name=files.name, belt=read_belt(files.belt_speed_m_s), stated_contacts=tuple(files.feet)
    )
    apart = files.forces is not None and len(wanted.trials) > 1 and not wanted.instruments.same_plates
    used = with_plates_of_trial(recording) if apart else recording
    return TrialInput(used, files.window_s, seconds, files.use, files.task, files.condition)


def _as_used(wanted: SubjectFile, recording: Recording) -> Recording:
    """Return the recording with the plates that the laboratory uses, and their unloaded readings restored where it
    states that they were zeroed.
    """
    plates = recording.plates
    if plates is None:
        return recording
    if wanted.instruments.plates is not None and set(wanted.instruments.plates) & set(plates.names):
        plates = selected(plates, wanted.instruments.plates)
    return replace(recording, plates=with_unloaded_levels(plates) if wanted.instruments.zeroed else plates)


def _expect_plates(recording: Recording, names: Sequence[str], entry: str) -> None:
    """Raise a SettingsError about a plate that the recording does not have."""
    known = () if recording.plates is None else recording.plates.names
    missing = [name for name in names if name not in known]
    if missing and (known or entry.startswith("[[trial]]")):
        problem = f"{recording.name} has no '{missing[0]}'; its plates are {', '.join(known) or 'none'}"
        raise SettingsError.of_entry(entry, problem)
