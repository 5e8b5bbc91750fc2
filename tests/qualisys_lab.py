"""A synthetic laboratory of Qualisys: the package's walker with Qualisys' labels, in C3D as QTM's manual describes it.

Millimetres, Z up; full labels; plates of type 2 with one channel per component, and other analog channels of the same
rate beside them; missing places have the residual -1; events by label and context, from the original start of the
measurement.
"""

from dataclasses import replace
from pathlib import Path

import ezc3d
import numpy as np

from kinertia.io.c3d.writer import write_c3d
from kinertia.model.skeleton import Marker
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.synthetic.laboratory import LabNoise, record
from kinertia.synthetic.walk import SyntheticSubject, unlike_literature, walk
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers, Recording
from kinertia.trial.sampled_data import runs
from synthetic_lab import symmetric_person

RATE_HZ, SAMPLES_PER_FRAME = 100.0, 10
STATIC_ONLY = ("R_FME", "L_FME", "R_TAM", "L_TAM")
_ON_PELVIS = {"R_IAS": "R.ASIS", "L_IAS": "L.ASIS"}
_ON_LEG = {"FLE": ("thigh", "Knee.Lat"), "FME": ("thigh", "Knee.Med"), "FAL": ("shank", "Ankle.Lat")}
_ON_LEG |= {
    "TAM": ("shank", "Ankle.Med"),
    "FCC": ("foot", "Heel"),
    "FM1": ("foot", "Toe.Med"),
    "FM5": ("foot", "Toe.Lat"),
}
_BESIDE = {"FTC": ("thigh", "Knee.Lat", 0.33), "FAX": ("shank", "Ankle.Lat", 0.33), "TTC": ("shank", "Ankle.Lat", 0.36)}
"""By the marker at the lower end of the segment, and how far above it (m)."""


def write_qualisys_lab(folder: Path) -> Path:
    """Write `anna/static.c3d`, `anna/walk.c3d` and the same of `ben` into the folder; returns it."""
    for name, seed in (("anna", 7), ("ben", 8)):
        (folder / name).mkdir()
        _write_person(folder / name, seed)
    return folder


def _write_person(folder: Path, seed: int) -> None:
    truth, noise = np.random.default_rng(seed).spawn(2)
    walker = unlike_literature(symmetric_person(), truth)
    person = with_qualisys_labels(walker)
    trial = replace(walk(walker, 2.7, RATE_HZ * SAMPLES_PER_FRAME, 0.75), skeleton=person.skeleton)
    recorded = record(person, trial, LabNoise(), noise, SAMPLES_PER_FRAME)
    seen = [k for k, label in enumerate(recorded.walk.markers.labels) if label not in STATIC_ONLY]
    markers = recorded.walk.markers
    markers = Markers(markers.time, tuple(markers.labels[k] for k in seen), markers.positions[:, seen])
    plates = recorded.walk.plates
    sides = []
    for p in range(2):
        peak = int(np.argmax(plates.force[:, p, 1]))
        apart = np.abs(trial.foot_loads[peak, :, 1] - plates.force[peak, p, 1])
        sides.append(("Right", "Left")[int(np.argmin(apart))])
    events = []
    for p, side in enumerate(sides):
        ((first, last),) = runs(plates.force[:, p, 1] > LOAD_THRESHOLD_N)
        events += [(float(plates.time[first]), side, "Foot Strike"), (float(plates.time[last]), side, "Foot Off")]
    _write(folder / "static.c3d", replace(recorded.static, mass_kg=None, height_m=None), [])
    _write(folder / "walk.c3d", replace(recorded.walk, markers=markers, mass_kg=None, height_m=None), events)


def with_qualisys_labels(person: SyntheticSubject) -> SyntheticSubject:
    """The same person with the markers of the preset `qualisys-lower-body`."""
    markers, positions = person.static.markers, {marker.label: marker.position for marker in person.skeleton.markers}
    q = solve_ik(person.skeleton, markers).q[:1]
    up, side_way = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    placed = [Marker(label, "pelvis", positions[old]) for label, old in _ON_PELVIS.items()]
    placed += [
        Marker("CV7", "torso", positions["Sternum"] + [-0.16, 0.09, 0.0]),
        Marker("SJN", "torso", positions["Sternum"]),
    ]
    placed.append(Marker("SXS", "torso", positions["Sternum"] + [0.03, -0.14, 0.0]))
    for side, sign in (("R", 1.0), ("L", -1.0)):
        low = side.lower()
        placed.append(Marker(f"{side}_IPS", "pelvis", positions["V.Sacral"] + 0.045 * sign * side_way))
        placed.append(Marker(f"{side}_SAE", "torso", positions[f"{side}.Acromium"]))
        for code, (segment, old) in _ON_LEG.items():
            placed.append(Marker(f"{side}_{code}", f"{segment}_{low}", positions[f"{side}.{old}"]))
        for code, (segment, old, above) in _BESIDE.items():
            place = (
                positions[f"{side}.{old}"]
                + above * up
                + (0.02 * sign * side_way if code != "TTC" else [0.05, 0.0, 0.0])
            )
            placed.append(Marker(f"{side}_{code}", f"{segment}_{low}", place))
        between = (positions[f"{side}.Toe.Med"] + positions[f"{side}.Toe.Lat"]) / 2.0
        placed.append(Marker(f"{side}_FM2", f"foot_{low}", between + 0.01 * up))
    skeleton = person.skeleton.with_markers(placed)
    places = np.repeat(skeleton.marker_positions(skeleton.pose(q)), len(markers.time), axis=0)
    return replace(
        person, static=Recording("static", Markers(markers.time, skeleton.labels, places)), skeleton=skeleton
    )


def _write(path: Path, recording: Recording, events: list[tuple[float, str, str]]) -> None:
    write_c3d(path, recording)
    file = ezc3d.c3d(str(path))
    points = file["data"]["points"]
    file["data"]["meta_points"]["residuals"][0, np.isnan(points[0])] = -1.0
    file.add_parameter("MANUFACTURER", "COMPANY", ["Qualisys AB"])
    file.add_parameter("MANUFACTURER", "SOFTWARE", ["Qualisys Track Manager"])
    file.add_parameter("MANUFACTURER", "VERSION_LABEL", ["2025.1"])
    if recording.plates is not None:
        analogs, analog = file["data"]["analogs"], file["parameters"]["ANALOG"]
        emg = 1e-4 * np.random.default_rng(8).normal(size=(1, 1, analogs.shape[2]))
        file["data"]["analogs"] = np.concatenate([analogs, emg], axis=1)
        named = [f"{name}{axis}{p}" for p in (1, 2) for name in ("Force_", "Moment_") for axis in "XYZ"]
        analog["LABELS"]["value"] = [*named, "R_RF EMG"]
        analog["UNITS"]["value"] = [*analog["UNITS"]["value"], "V"]
        analog["DESCRIPTIONS"]["value"] = ["Force-plate 1"] * 6 + ["Force-plate 2"] * 6 + ["EMG"]
        analog["SCALE"]["value"], analog["OFFSET"]["value"] = np.ones(13), np.zeros(13, dtype=int)
    if events:
        times, contexts, labels = zip(*sorted(events), strict=True)
        file.add_parameter("EVENT", "USED", [len(events)])
        file.add_parameter("EVENT", "CONTEXTS", list(contexts))
        file.add_parameter("EVENT", "LABELS", list(labels))
        file.add_parameter("EVENT", "TIMES", np.array([np.zeros(len(times)), times]))
    file.write(str(path))
