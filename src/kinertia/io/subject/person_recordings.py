"""Reads the recordings that a subject file names: static trial, motions, belts, and the day of recording.

The date of a file on the disk is that of its export or copy, and the dates of processing that Nexus writes into C3D
files are those of processing: neither is taken.
"""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, SettingsError
from kinertia.findings.quantity import Quantity
from kinertia.io.c3d import structure as c3d_structure
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.subject.tables import SubjectFile, TrialFiles
from kinertia.io.text.csv_file import has_columns, read_csv
from kinertia.io.text.sto import read_table
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording
from kinertia.trial.file_contents import Belt
from kinertia.trial.plate_loading import with_unloaded_levels
from kinertia.trial.trial_input import TrialInput, selected, with_plates_of_trial

Progress = Callable[[str, float], None]
_ONE_CSV, _TWO_CSV = ("speed_m_s",), ("right_m_s", "left_m_s")
_ONE, _TWO = ("belt_speed",), ("belt_speed_right", "belt_speed_left")
FASTEST_M_S = 15.0
_HEADING_BYTES = 4096
_TIME_STAMP = re.compile(rb"^TIME_STAMP\t(\d{4})-(\d{2})-(\d{2})\b", re.MULTILINE)


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
    recording = _as_used(wanted, read.without_markers(files.leave_out))
    _expect_plates(recording, [contact.plate for contact in files.feet], "[[trial]] feet")
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


def read_belt(stated: float | tuple[float, float] | Path | None) -> Belt | None:
    """Read the speed of a treadmill's belt as a subject file states it: m/s, for two belts the speeds under the right
    and the left foot, or a file with the speed over the markers' time.

    CSV has the columns `time_s` and `speed_m_s`, of two belts `time_s`, `right_m_s` and `left_m_s`; MOT and STO, which
    may be the force file, a column `belt_speed`, of two belts `belt_speed_right` and `belt_speed_left`.

    Raises:
        FileError: the file is missing or broken, lacks the columns, time does not increase, or a speed is impossible
            for a treadmill.
    """
    if stated is None:
        return None
    if isinstance(stated, float | tuple):
        return Belt(np.zeros(1), np.array([stated]))
    path = stated
    time, speed = _from_table(path) if path.suffix.lower() in (".mot", ".sto") else _from_csv(path)
    if not (np.isfinite(speed).all() and (np.diff(time) > 0).all()):
        raise FileError.found(path, "F181", problem=Quantity("times must increase, with a speed for each"))
    if speed.min() < 0 or speed.max() > FASTEST_M_S:
        range_ = Quantity((float(speed.min()), float(speed.max())), "m/s", limit=FASTEST_M_S)
        problem = f"speeds from {speed.min():g} to {speed.max():g} m/s; a treadmill's are 0 to {FASTEST_M_S:g} m/s"
        raise FileError.found(path, "F181", speed_m_s=range_, problem=Quantity(problem))
    return Belt(time, speed)


def _from_table(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and one speed or the speeds under right and left foot."""
    table = read_table(path)
    names = next((names for names in (_ONE, _TWO) if set(names) <= set(table.labels)), None)
    if names is None:
        lacking = f"no column {_ONE[0]} in m/s, nor {' and '.join(_TWO)} for two belts"
        raise FileError.found(path, "F181", problem=Quantity(f"{lacking}; found {', '.join(table.labels)}"))
    return table.time, _one_or_two(table.columns(list(names)))


def _from_csv(path: Path) -> tuple[np.ndarray, np.ndarray]:
    names = ("time_s", *(_TWO_CSV if has_columns(path, _TWO_CSV) else _ONE_CSV))
    expected = f"a row per time: {','.join(('time_s', *_ONE_CSV))}, of two belts {','.join(('time_s', *_TWO_CSV))}"
    rows = np.array([[row.number(name) for name in names] for row in read_csv(path, names, expected)])
    return rows[:, 0], _one_or_two(rows[:, 1:])


def _one_or_two(speeds: np.ndarray) -> np.ndarray:
    return speeds[:, 0] if speeds.shape[1] == 1 else speeds


def session_date(wanted: SubjectFile) -> date | None:
    """Return the date in the subject file, or of the first gait trial that states one; None where none does."""
    stated = wanted.instruments.date
    said = (recording_date(trial.markers) for trial in wanted.trials)
    return stated or next((day for day in said if day is not None), None)


def recording_date(path: Path) -> date | None:
    """Return the date from TRIAL:DATE of a C3D file (year, month, day: BTS), or TIME_STAMP of a Qualisys .tsv file."""
    try:
        if path.suffix.lower() == ".c3d":
            numbers = c3d_structure.trial_date(path)
        elif path.suffix.lower() == ".tsv":
            with path.open("rb") as stream:
                found = _TIME_STAMP.search(stream.read(_HEADING_BYTES))
            numbers = () if found is None else tuple(int(part) for part in found.groups())
        else:
            return None
        year, month, day = numbers
        return date(year, month, day)
    except (FileError, OSError, ValueError):
        return None
