"""Reads one trial from its files, in any format."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, KinertiaError, TrialError, expect_file, wrong_kind
from kinertia.findings.extensions import READERS, loaded, names
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.io.ground_forces import read_forces
from kinertia.io.lab_plates import upright_along_z
from kinertia.io.text.trc import read_trc_recording
from kinertia.model.static_landmarks import with_knees_of_device
from kinertia.trial.data import FloatArray, PlateLoads, Recording
from kinertia.trial.sampled_data import impossible_load, impossible_position

ADDED_FILES = tuple(f".{name}" for name in names(READERS))
MARKER_FILES = (".trc", ".c3d", ".tsv", ".csv", *ADDED_FILES)
CORTEX = ".forces"
_SUBJECT = ".b3d"
FORCE_FILES = (".mot", ".sto", ".tsv", CORTEX)
"""Endings of what is read; those of installed packages that extend Kinertia are read by their functions."""
FARTHEST_M, STRONGEST_N = Limit(1000.0, "m"), Limit(1e6, "N")
"""Farther and stronger than anything in a laboratory."""


def read_recording(
    markers_path: str | Path,
    forces_path: str | Path | None = None,
    loads_path: str | Path | None = None,
    length_unit: str | None = None,
    standing: bool = False,
) -> Recording:
    """Read one trial: markers, and forces if any.

    Args:
        markers_path: a .trc or .c3d file, a .tsv file of Qualisys, or a .csv file of Vicon.
        forces_path: a .mot or .sto file, or a .forces file of Cortex; its forces precede those of the markers' file.
            Also the .tsv file of a Qualisys plate: the files of the trial's other plates beside it are then read as
            well.
        loads_path: an OpenSim ExternalLoads .xml file that identifies the force columns. Without
            `forces_path` its own datafile is read.
        length_unit: of a .c3d file's lengths, "mm", "cm" or "m", overriding the file.
        standing: the person stands, as in a static trial: poses of a .c3d file (Theia) are read as one frame of the
            person standing upright, and markers of a .trc file as upright along Z where they reach farthest along it.

    Returns:
        the recording; its `plates` is None where no file holds usable force plates. A person who stands along Z in a
        .trc file is rotated to Y up, together with the forces of a file.

    Raises:
        FileError: a file is missing, broken, or of a kind that Kinertia does not read.
        TrialError: forces and markers do not overlap in time.
    """
    markers_path = Path(markers_path)
    expect_recording(markers_path)
    _expect_kind(markers_path, MARKER_FILES, "markers")
    tsv = forces_path is not None and Path(forces_path).suffix.lower() == ".tsv"
    recording = _read_markers(markers_path, Path(str(forces_path)) if tsv else None, length_unit, standing)
    recording = with_knees_of_device(recording, markers_path.name)
    is_trc = markers_path.suffix.lower() == ".trc"
    turn = upright_along_z(recording.markers.positions, standing) if is_trc else None
    if turn is not None:
        recording = _turned(recording, markers_path, turn)
    if tsv:
        forces_path = None
    if forces_path is not None:
        _expect_kind(Path(forces_path), FORCE_FILES, "forces")
    if loads_path is not None:
        _expect_kind(Path(loads_path), (".xml",), "external loads")
    if forces_path is not None or loads_path is not None:
        plates, findings = _forces(forces_path, loads_path, turn)
        if recording.plates is not None:
            findings = (finding("F158", Where(markers_path.name)), *findings)
        recording = replace(recording, plates=plates, findings=(*_of_markers(recording), *findings))
    _expect_overlap(recording)
    _expect_laboratory(markers_path, recording)
    return recording


def _forces(
    path: str | Path | None, loads_path: str | Path | None, turn: FloatArray | None
) -> tuple[PlateLoads, tuple[Finding, ...]]:
    """Read the plates of a force file, with findings."""
    if path is None or Path(path).suffix.lower() != CORTEX:
        return read_forces(path, loads_path, turn)
    if loads_path is not None:
        raise wrong_kind(Path(loads_path), "An ExternalLoads file", f"explain a {CORTEX} file", "a .mot or .sto file")
    from kinertia.io.text.cortex import read_cortex_forces

    return read_cortex_forces(path, turn)


def _of_markers(recording: Recording) -> list[Finding]:
    """Return findings without those about the markers file's own plates, where plates of a force file replace them."""
    return [reported for reported in recording.findings if reported.code != "F151" and reported.where.plate is None]


def _read_markers(path: Path, plate: Path | None, length_unit: str | None, standing: bool) -> Recording:
    """Read a file of markers; a format's reader is loaded only when needed."""
    kind = path.suffix.lower()
    if length_unit is not None and kind != ".c3d":
        raise wrong_kind(path, f"A '{kind}' file", "take a length_unit, since it states its own", "a .c3d file")
    if plate is not None:
        expect_file(plate)
        if kind != ".tsv":
            raise wrong_kind(plate, "A plate of Qualisys", f"go with markers in a '{kind}' file", "a .tsv file of them")
    if kind == ".c3d":
        from kinertia.io.c3d.reader import read_c3d

        return read_c3d(path, length_unit, standing)
    if kind == ".tsv":
        from kinertia.io.text.qualisys import plates_beside, read_qualisys

        return read_qualisys(path, None if plate is None else plates_beside(plate))
    if kind == ".csv":
        from kinertia.io.text.vicon import read_vicon_csv

        return read_vicon_csv(path)
    return read_trc_recording(path) if kind == ".trc" else _read_by_package(path)


def _read_by_package(path: Path) -> Recording:
    """Read a file of an ending that an installed package adds; what it raises is a fault of the file."""
    try:
        read: Recording = loaded(READERS, path.suffix.lower().removeprefix("."))(path)
    except KinertiaError:
        raise
    except Exception as error:
        raise FileError(path, f"the package that reads such files failed: {error!r}") from error
    return read


def _turned(recording: Recording, path: Path, turn: FloatArray) -> Recording:
    """Rotate the markers of a TRC file that was not written with Y up, as the format assumes."""
    rotated = finding("F133", Where(path.name), axis=Quantity("+Z"), source=Quantity("upright people"))
    return replace(
        recording,
        markers=recording.markers.rotated(turn),
        vertical="+Z",
        findings=(*recording.findings, rotated),
    )


def expect_recording(path: Path) -> None:
    """Raise a FileError for a file of a subject with many recordings (AddBiomechanics' .b3d)."""
    if path.suffix.lower() == _SUBJECT:
        raise FileError(path, "holds a subject's trials: kinertia.read_b3d reads them all, in Python")


def _expect_kind(path: Path, suffixes: tuple[str, ...], what: str) -> None:
    if path.suffix.lower() not in suffixes:
        known = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        raise wrong_kind(path, f"A '{path.suffix}' file", f"hold {what}", known)
    expect_file(path)


def _expect_laboratory(path: Path, recording: Recording) -> None:
    """Raise a FileError for positions or loads that are impossible in a laboratory: one broken number spoils
    everything."""
    markers, plates = recording.markers, recording.plates
    far = np.argwhere(np.abs(markers.positions) > FARTHEST_M)
    if far.size:
        frame, marker, axis = far[0]
        position_m, time_s = float(markers.positions[frame, marker, axis]), float(markers.time[frame])
        wrong = impossible_position(markers.labels[marker], position_m, time_s, FARTHEST_M)
        raise FileError.of(path, wrong)
    if plates is None:
        return
    loads = np.concatenate((plates.force, plates.moment / FARTHEST_M), axis=2)
    strong = np.argwhere(~(np.abs(loads) < STRONGEST_N))
    if strong.size:
        frame, plate, axis = strong[0]
        what, unit, limit = ("force", "N", STRONGEST_N) if axis < 3 else ("moment", "N m", STRONGEST_N * FARTHEST_M)
        name, value = "force_n" if axis < 3 else "moment_nm", float(plates.wrench[frame, plate, axis])
        size = {name: Quantity(value, unit, limit=limit)} if np.isfinite(value) else {}
        load = impossible_load(plates.names[plate], what, float(plates.time[frame]), **size)
        raise TrialError.of(recording.name, load)


def _expect_overlap(recording: Recording) -> None:
    if recording.plates is None:
        return
    markers, forces = recording.markers.time, recording.plates.time
    if forces[0] > markers[-1] or forces[-1] < markers[0]:
        forces_s, markers_s = (Quantity((float(time[0]), float(time[-1])), "s") for time in (forces, markers))
        raise TrialError.found(
            recording.name,
            "T111",
            forces_s=forces_s,
            markers_s=markers_s,
            forces=_span(forces),
            frames=_span(markers),
        )


def _span(time: FloatArray) -> Quantity:
    return Quantity(f"{time[0]:.3f} to {time[-1]:.3f} s")


def frame_count(path: Path) -> int:
    """Return the number of frames in the header of a .c3d or .trc file; 0 where not stated (reading explains why)."""
    from kinertia.io.c3d import structure as c3d_structure
    from kinertia.io.text import trc

    try:
        return c3d_structure.header_frames(path) if path.suffix.lower() == ".c3d" else trc.header_frames(path)
    except (FileError, OSError):
        return 0
