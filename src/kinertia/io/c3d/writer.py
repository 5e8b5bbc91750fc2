"""Writes a `Recording` as a C3D file, as a laboratory's software would: lab axes with Z up, mm, type-2 force plates."""

from pathlib import Path
from typing import Any

import numpy as np

from kinertia.io.c3d.ezc3d_library import new_c3d, save_c3d
from kinertia.io.c3d.plates import plate_axes
from kinertia.trial.data import FloatArray, PlateLoads, Recording

_TO_LAB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Ground axes (Y up) to lab axes (Z up): x stays, lab y points to the person's left."""
_MM = 1000.0
_CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def write_c3d(path: str | Path, recording: Recording) -> None:
    """Write markers, force plates, mass, height and measurements to a C3D file; numbers are in single precision.

    Plate channels hold the force on the person and its moment about the middle of the plate's surface, in plate axes.

    Args:
        path: the file.
        recording: its plates, if any, have corners, start with the markers and have a whole number of samples per
            frame.

    Raises:
        FileError: ezc3d is not installed.
        ValueError: the plates have no corners, or their time base does not fit the markers'.
    """
    path = Path(path)
    file = new_c3d(path)
    markers, parameters = recording.markers, file["parameters"]
    parameters["POINT"]["LABELS"]["value"] = list(markers.labels)
    parameters["POINT"]["UNITS"]["value"] = ["mm"]
    parameters["POINT"]["RATE"]["value"] = [markers.rate_hz]
    file["header"]["points"]["first_frame"] = round(float(markers.time[0]) * markers.rate_hz)
    places = np.moveaxis(_MM * markers.positions @ _TO_LAB.T, 2, 0).swapaxes(1, 2)
    file["data"]["points"] = np.concatenate([places, np.ones((1, *places.shape[1:]))])
    file.add_parameter("POINT", "X_SCREEN", "+X")
    file.add_parameter("POINT", "Y_SCREEN", "+Z")
    if recording.mass_kg is not None:
        file.add_parameter("PROCESSING", "Bodymass", float(recording.mass_kg))
    if recording.height_m is not None:
        file.add_parameter("PROCESSING", "Height", _MM * recording.height_m)
    for name, length_m in recording.measurements.items():
        file.add_parameter("PROCESSING", name, _MM * length_m)
    if recording.plates is not None:
        _add_plates(file, recording.plates, _samples_per_frame(recording, recording.plates))
    save_c3d(file, path)


def _samples_per_frame(recording: Recording, plates: PlateLoads) -> int:
    markers = recording.markers
    ratio, rest = divmod(len(plates.time), len(markers.time))
    step = 1.0 / (markers.rate_hz * max(ratio, 1))
    if rest or np.abs(plates.time - markers.time[0] - step * np.arange(len(plates.time))).max() > 1e-6:
        raise ValueError("plates must start with the markers and have a whole number of samples per frame")
    return ratio


def _add_plates(file: Any, plates: PlateLoads, samples_per_frame: int) -> None:
    if plates.corners is None:
        raise ValueError("a C3D file needs the corners of its force plates")
    count, parameters = len(plates.names), file["parameters"]
    middle = plates.corners.mean(axis=1)
    about_middle = plates.moment - np.cross(middle, plates.force)
    corners = [_ordered(_MM * corner @ _TO_LAB.T) for corner in plates.corners]
    turns = np.array([plate_axes(corner).T @ _TO_LAB for corner in corners])
    force, moment = (np.einsum("pij,kpj->kpi", turns, component) for component in (plates.force, _MM * about_middle))
    channels = np.concatenate([force, moment], axis=-1)
    file["data"]["analogs"] = channels.reshape(1, len(plates.time), 6 * count).swapaxes(1, 2)
    parameters["ANALOG"]["RATE"]["value"] = [parameters["POINT"]["RATE"]["value"][0] * samples_per_frame]
    parameters["ANALOG"]["LABELS"]["value"] = [f"{name}{p}" for p in range(1, count + 1) for name in _CHANNELS]
    parameters["ANALOG"]["UNITS"]["value"] = (3 * ["N"] + 3 * ["Nmm"]) * count
    for name, value in (
        ("USED", [count]),
        ("TYPE", [2] * count),
        ("ZERO", [1, 0]),
        ("ORIGIN", np.zeros((3, count))),
        ("CHANNEL", np.arange(1, 6 * count + 1).reshape(count, 6).T),
        ("CORNERS", np.moveaxis(np.array(corners), 0, 2).swapaxes(0, 1)),
    ):
        parameters["FORCE_PLATFORM"][name]["value"] = np.asarray(value)


def _ordered(corners: FloatArray) -> FloatArray:
    """Order corners (4, 3) in lab axes by the quadrants of the plate's axes: (+, +), (-, +), (-, -), (+, -).

    The plate's z points down, as plates are built, and its x is as close to the lab's as a corner allows.
    """
    x, y, _ = (corners - corners.mean(axis=0)).T
    clockwise = np.argsort(np.arctan2(y, x))[::-1]  # from above; counterclockwise about the plate's z
    first = int(np.argmax((x - y)[clockwise]))
    return corners[np.roll(clockwise, -first)]
