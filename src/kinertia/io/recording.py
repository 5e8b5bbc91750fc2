"""One trial from its files, whatever their formats."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, TrialError
from kinertia.io.ground_forces import read_forces_with_notes
from kinertia.io.lab_axes import upright_along_z
from kinertia.io.number_table import expect_file
from kinertia.io.trc import read_trc_recording
from kinertia.trial.data import FloatArray, Recording

MARKER_FILES = (".trc", ".c3d", ".tsv", ".csv")
FORCE_FILES = (".mot", ".sto", ".tsv")
"""Endings of what is read."""
_FARTHEST_M, _STRONGEST_N = 1000.0, 1e6
"""Farther and stronger than anything in a laboratory."""


def read_recording(
    markers_path: str | Path,
    forces_path: str | Path | None = None,
    loads_path: str | Path | None = None,
    length_unit: str | None = None,
    standing: bool = False,
) -> Recording:
    """Read one trial: markers, and forces where there are any.

    Args:
        markers_path: a .trc or .c3d file, a .tsv file of Qualisys, or a .csv file of Vicon.
        forces_path: a .mot or .sto file; its forces go before those of the markers' file. Of Qualisys also the .tsv
            file of a plate: those of the trial's other plates beside it are read, too.
        loads_path: an OpenSim ExternalLoads .xml file that says which force column is what. Without
            `forces_path` its own datafile is read.
        length_unit: of a .c3d file's lengths, "mm", "cm" or "m", whatever it says itself.
        standing: of a .c3d file of poses (Theia), the same person standing upright, as a static trial.

    Returns:
        the recording; its `plates` is None where no file holds usable force plates. Somebody who stands along Z in a
        .trc file is turned to Y up, and the forces of a file with them.

    Raises:
        FileError: a file is missing, broken, or of a kind that Kinertia does not read.
        TrialError: forces and markers do not overlap in time.
    """
    markers_path = Path(markers_path)
    _expect_kind(markers_path, MARKER_FILES, "markers")
    tsv = forces_path is not None and Path(forces_path).suffix.lower() == ".tsv"
    recording = _read_markers(markers_path, Path(str(forces_path)) if tsv else None, length_unit, standing)
    turn = upright_along_z(recording.markers.positions) if markers_path.suffix.lower() == ".trc" else None
    if turn is not None:
        recording = _turned(recording, markers_path, turn)
    if tsv:
        forces_path = None
    if forces_path is not None:
        _expect_kind(Path(forces_path), FORCE_FILES, "forces")
    if loads_path is not None:
        _expect_kind(Path(loads_path), (".xml",), "external loads")
    if forces_path is not None or loads_path is not None:
        plates, notes = read_forces_with_notes(forces_path, loads_path, turn)
        if recording.plates is not None:
            notes = (f"{markers_path.name}: its own force plates were not used, the force file was", *notes)
        recording = replace(recording, plates=plates, notes=(*recording.notes, *notes), left_out=())
    _expect_overlap(recording)
    _expect_laboratory(markers_path, recording)
    return recording


def _read_markers(path: Path, plate: Path | None, length_unit: str | None, standing: bool) -> Recording:
    """What a file of markers holds; readers are loaded by those who have such files."""
    kind = path.suffix.lower()
    if length_unit is not None and kind != ".c3d":
        raise FileError(path, "length_unit is for C3D files; this one says its own unit")
    if plate is not None:
        expect_file(plate)
        if kind != ".tsv":
            raise FileError(plate, "a plate of Qualisys goes with markers of Qualisys; expected a .tsv file of markers")
    if kind == ".c3d":
        from kinertia.io.c3d import read_c3d

        return read_c3d(path, length_unit, standing)
    if kind == ".tsv":
        from kinertia.io.qualisys import plates_beside, read_qualisys

        return read_qualisys(path, None if plate is None else plates_beside(plate))
    if kind == ".csv":
        from kinertia.io.vicon_csv import read_vicon_csv

        return read_vicon_csv(path)
    return read_trc_recording(path)


def _turned(recording: Recording, path: Path, turn: FloatArray) -> Recording:
    """Markers of a TRC file, which takes Y to be up and has not been written so."""
    note = f"{path.name}: people stand upright along Z; markers, and forces with them, were turned to Y up"
    return replace(recording, markers=recording.markers.rotated(turn), vertical="+Z", notes=(*recording.notes, note))


def _expect_kind(path: Path, suffixes: tuple[str, ...], what: str) -> None:
    if path.suffix.lower() not in suffixes:
        known = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        raise FileError(path, f"cannot read {what} from a '{path.suffix}' file; expected {known}")
    expect_file(path)


def _expect_laboratory(path: Path, recording: Recording) -> None:
    """Raise a FileError that names a place or load that no laboratory has: a broken number spoils all that follows."""
    markers, plates = recording.markers, recording.plates
    far = np.argwhere(np.abs(markers.positions) > _FARTHEST_M)
    if far.size:
        frame, marker, axis = far[0]
        raise FileError(
            path,
            f"marker {markers.labels[marker]} is {markers.positions[frame, marker, axis]:.3g} m away at "
            f"{markers.time[frame]:g} s; expected at most {_FARTHEST_M:g} m: repair the number, or the unit of lengths",
        )
    if plates is None:
        return
    loads = np.concatenate((plates.force, plates.moment / _FARTHEST_M), axis=2)
    strong = np.argwhere(~(np.abs(loads) < _STRONGEST_N))
    if strong.size:
        frame, plate, axis = strong[0]
        raise TrialError(
            recording.name,
            f"{plates.names[plate]} has a {'force' if axis < 3 else 'moment'} that no plate measures at "
            f"{plates.time[frame]:g} s; repair the number, or the unit of forces",
        )


def _expect_overlap(recording: Recording) -> None:
    if recording.plates is None:
        return
    markers, forces = recording.markers.time, recording.plates.time
    if forces[0] > markers[-1] or forces[-1] < markers[0]:
        raise TrialError(
            recording.name,
            f"forces from {forces[0]:.3f} to {forces[-1]:.3f} s and markers from {markers[0]:.3f} to "
            f"{markers[-1]:.3f} s do not overlap; give files of the same trial on the same clock",
        )
