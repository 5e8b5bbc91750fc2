"""A walk over two plates, written as Qualisys Track Manager and Vicon Nexus document their text exports."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from kinertia.trial.data import FloatArray, Recording
from walk_on_plates import walk

LAB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Laboratory axes, z up, to ground axes."""
AXES = np.array([np.eye(3), [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]])
"""Rows: axes of both plates in the laboratory's; those of the second are turned, z down."""
CORNERS_M = np.array(
    [
        [
            [x, z, 0.0] + 0.4 * (along * axes[0] + across * axes[1])
            for along, across in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ]
        for (x, z), axes in zip(((0.0, -0.1), (0.6, 0.1)), AXES, strict=True)
    ]
)
"""Of both plates in the laboratory's axes, in QTM's order."""
_NAMES = ("POSX_POSY", "NEGX_POSY", "NEGX_NEGY", "POSX_NEGY")


def lab_walk() -> Recording:
    """Two steps on plates, with forces that vary and a free moment; a marker at the head says what is up."""
    recording = walk([("r", 0), ("l", 0)], duration_s=1.5)
    plates, markers = recording.plates, recording.markers
    force, moment = plates.force.copy(), plates.moment.copy()
    share = 1.0 + 0.3 * np.sin(40.0 * plates.time)[:, None]
    sway = 0.02 * np.cos(25.0 * plates.time)
    for p in range(2):
        on = force[:, p, 1] > 0
        force[on, p] *= share[on]
        force[on, p, 0] += 60.0 * np.sin(9.0 * plates.time[on])
        place = np.column_stack([0.6 * p + sway, np.zeros_like(sway), 0.1 * (1 - 2 * p) + 2.0 * sway])
        moment[:, p] = np.cross(place, force[:, p])
        moment[on, p, 1] += 4.0 * np.sin(12.0 * plates.time[on])
    head = np.column_stack([1.2 * markers.time, np.full_like(markers.time, 1.7), np.zeros_like(markers.time)])
    positions = np.concatenate([markers.positions, head[:, None]], axis=1)
    return replace(
        recording,
        markers=replace(markers, labels=(*markers.labels, "Head"), positions=positions),
        plates=replace(plates, force=force, moment=moment),
    )


def in_lab(recording: Recording, p: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Force, free moment vector and centre of pressure (k, 3) of a plate in the laboratory's axes, N, N m, m."""
    force, moment = recording.plates.force[:, p] @ LAB, recording.plates.moment[:, p] @ LAB
    vertical = np.where(force[:, 2] == 0.0, 1.0, force[:, 2])
    point = np.column_stack([-moment[:, 1], moment[:, 0], np.zeros(len(force))]) / vertical[:, None]
    return force, moment - np.cross(point, force), point


def write_qtm(path: Path, recording: Recording, local: bool = False, counted: bool = False, hole: str = "") -> Path:
    """Markers to `path`, each plate to a file beside it."""
    markers = recording.markers
    rows = 1000.0 * markers.positions @ LAB
    names = "\t".join(markers.labels)
    lines = [
        f"NO_OF_FRAMES\t{len(rows)}",
        "NO_OF_CAMERAS\t8",
        f"NO_OF_MARKERS\t{len(markers.labels)}",
        f"FREQUENCY\t{markers.rate_hz:g}",
        "NO_OF_ANALOG\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2024-05-02, 10:11:12.345\t9912.56663253",
        "DATA_INCLUDED\t3D",
        "EVENT\tfirst contact\t20\t0.2",
        f"MARKER_NAMES\t{names}",
    ]
    if counted:
        lines.append("Frame\tTime\t" + "\t".join(f"{label} {axis}" for label in markers.labels for axis in "XYZ"))
    for k, (time, row) in enumerate(zip(markers.time, rows.reshape(len(rows), -1), strict=True), start=1):
        cells = [hole if np.isnan(value) else f"{value:.6f}" for value in row]
        lines.append("\t".join([str(k), f"{time:.5f}", *cells] if counted else cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    for p, corners in enumerate(CORNERS_M):
        _write_plate(path.with_name(f"{path.stem}_f_{p + 1}.tsv"), recording, p, corners, local)
    return path


def _write_plate(path: Path, recording: Recording, p: int, corners: FloatArray, local: bool) -> None:
    force, free, point = in_lab(recording, p)
    middle = corners.mean(axis=0)
    moment = free + np.cross(point - middle, force)
    if local:
        force, moment, point = (part @ AXES[p].T for part in (force, moment, point - middle))
    axes = "local (force plate)" if local else "world (lab)"
    rate = (len(force) - 1) / np.ptp(recording.plates.time)
    lines = [
        f"NO_OF_SAMPLES\t{len(force)}",
        f"FREQUENCY\t{rate:g}",
        "FIRST_SAMPLE\t1",
        f"DESCRIPTION\tForce data in {axes} coordinates",
        "DATA_INCLUDED\tForce",
        "FORCE_PLATE_TYPE\tKistler",
        f"FORCE_PLATE_NAME\tForce-plate {p + 1}",
        *(
            f"FORCE_PLATE_CORNER_{name}_{axis}\t{1000.0 * corner[i]:.3f}"
            for name, corner in zip(_NAMES, corners, strict=True)
            for i, axis in enumerate("XYZ")
        ),
        "Force_X\tForce_Y\tForce_Z\tMoment_X\tMoment_Y\tMoment_Z\tCOP_X\tCOP_Y\tCOP_Z",
    ]
    rows = np.column_stack([force, moment, 1000.0 * point])
    lines += ["\t".join(f"{value:.6f}" for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_nexus(path: Path, recording: Recording, turn: FloatArray | None = None, mark: str = ",") -> Path:
    """Devices, model outputs and trajectories; forces in the plate's axes if these are turned in the laboratory's."""
    turn = np.eye(3) if turn is None else turn
    markers, plates = recording.markers, recording.plates
    rate, per_frame = markers.rate_hz, round((len(plates.time) - 1) / np.ptp(plates.time) / markers.rate_hz)
    cells = [["Devices"], [f"{rate * per_frame:g}"]]
    names = [f"Imported AMTI Plate #{p + 1}" for p in range(2)]
    cells.append(["", "", *(w for n in names for k in ("Force", "Moment", "CoP") for w in (f"{n} - {k}", "", ""))])
    cells[-1] += ["EMG - Voltage"]
    cells.append(["Frame", "Sub Frame", *(["Fx", "Fy", "Fz", "Mx", "My", "Mz", "Cx", "Cy", "Cz"] * 2), "EMG1"])
    cells.append(["", "", *(["N", "N", "N", "N.mm", "N.mm", "N.mm", "mm", "mm", "mm"] * 2), "V"])
    columns = []
    for p in range(2):
        force, free, point = in_lab(recording, p)
        moment = free + np.cross(point - CORNERS_M[p].mean(axis=0), force)
        columns += [force @ turn, 1000.0 * moment @ turn, 1000.0 * point]
    for k, row in enumerate(np.hstack(columns)):
        cells.append([str(k // per_frame + 1), str(k % per_frame), *(f"{value:.6f}" for value in row), "0.001"])
    cells += [[""], ["Model Outputs"], [f"{rate:g}"], ["", "", "Anna:LKneeAngles", "", ""]]
    cells += [["Frame", "Sub Frame", "X", "Y", "Z"], ["", "", "deg", "deg", "deg"], ["1", "0", "1", "2", "3"], [""]]
    cells += [["Trajectories"], [f"{rate:g}"], ["", "", *(w for n in markers.labels for w in (f"Anna:{n}", "", ""))]]
    cells += [["Frame", "Sub Frame", *("XYZ" * len(markers.labels))], ["", "", *(["mm"] * 3 * len(markers.labels))]]
    for k, row in enumerate((1000.0 * markers.positions @ LAB).reshape(len(markers.time), -1)):
        cells.append([str(k + 1), "0", *("" if np.isnan(value) else f"{value:.6f}" for value in row)])
    path.write_text("\n".join(mark.join(row) for row in cells) + "\n", encoding="utf-8")
    return path
