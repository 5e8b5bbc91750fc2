"""Reads subjects of AddBiomechanics (`.b3d`): several trials in one file, by nimblephysics if it can be installed.

Axes are OpenSim's (x forward, y up), lengths m, forces N. Only what the laboratory recorded is read, markers and force
plates, but not the model, motion and corrected forces of AddBiomechanics.
"""

from pathlib import Path
from typing import Any

import numpy as np

from kinertia.errors import FileError, expect_file
from kinertia.trial.data import Markers, PlateLoads, Recording

_HOW = (
    "needs nimblephysics, which is not installed: pip install nimblephysics (available for few versions of "
    "Python), or download TRC and MOT files from AddBiomechanics"
)


def read_b3d(path: str | Path) -> tuple[Recording, ...]:
    """Read all trials of a subject that have frames.

    Trials are named as in the file; two of one name get numbers. Mass and height are the subject's.

    Raises:
        FileError: no such file, nimblephysics is not installed, or the file is not from AddBiomechanics.
    """
    path = Path(path)
    expect_file(path)
    try:
        from nimblephysics_libs._nimblephysics import biomechanics
    except ImportError as error:
        raise FileError(path, _HOW) from error
    try:
        subject = biomechanics.SubjectOnDisk(str(path))
        count = subject.getNumTrials()
    except (RuntimeError, ValueError) as error:
        raise FileError(path, f"is not an AddBiomechanics subject, or is damaged ({error})") from error
    names = [subject.getTrialName(k) or f"trial {k + 1}" for k in range(count)]
    recordings = [
        _recording(subject, k, name if names.count(name) == 1 else f"{name}_{k + 1}")
        for k, name in enumerate(names)
        if subject.getTrialLength(k) > 1
    ]
    if not recordings:
        raise FileError(path, "holds no trial with frames; is it an AddBiomechanics subject?")
    return tuple(recordings)


def _recording(subject: Any, trial: int, name: str) -> Recording:
    frames = subject.readFrames(
        trial, 0, subject.getTrialLength(trial), includeSensorData=True, includeProcessingPasses=False
    )
    time = subject.getTrialTimestep(trial) * np.arange(len(frames))
    seen = [dict(frame.markerObservations) for frame in frames]
    labels = tuple(dict.fromkeys(label for places in seen for label in places))
    positions = np.full((len(frames), len(labels), 3), np.nan)
    for row, places in zip(positions, seen, strict=True):
        for label, place in places.items():
            row[labels.index(label)] = place
    markers, mass_kg, height_m = Markers(time, labels, positions), subject.getMassKg(), subject.getHeightM()
    return Recording(name, markers, _plates(frames, time), mass_kg=_stated(mass_kg), height_m=_stated(height_m))


def _stated(value: float) -> float | None:
    """Return a number stated in the file; None for zero or less, which AddBiomechanics writes for unknown values."""
    return float(value) if value > 0.0 else None


def _plates(frames: Any, time: np.ndarray) -> PlateLoads | None:
    """Return the loads at the frames as the plates measured them; None without plates."""
    force, torque, point = (
        np.array([[np.asarray(vector) for vector in getattr(frame, name)] for frame in frames], dtype=float)
        for name in ("rawForcePlateForces", "rawForcePlateTorques", "rawForcePlateCenterOfPressures")
    )
    if force.ndim < 3 or force.shape[1] == 0:
        return None
    loaded = np.isfinite(force).all(axis=2) & np.isfinite(torque).all(axis=2) & np.isfinite(point).all(axis=2)
    force, torque, point = (np.where(loaded[..., None], component, 0.0) for component in (force, torque, point))
    names = tuple(f"plate {k + 1}" for k in range(force.shape[1]))
    return PlateLoads(time, names, force, about_origin(force, torque, point), (None,) * len(names))


def about_origin(force: np.ndarray, torque: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return moments (n, p, 3) N m about the ground origin, whichever of both reference points the torques (n, p, 3)
    have.

    Laboratories wrote torques about the centre of pressure or the origin, and the file does not state which. About the
    centre of pressure their horizontal parts vanish.
    """
    arm = np.cross(point, force)
    horizontal = [0, 2]
    of_point, of_origin = (np.square(moment[..., horizontal]).sum(axis=(0, 2)) for moment in (torque, torque - arm))
    return torque + np.where((of_point <= of_origin)[:, None], arm, 0.0)
