"""A synthetic laboratory's files, which stand in for measured ones in tests where these are not there.

One person, symmetric, with the markers of the Cleveland Clinic: `static.trc`, `walk.trc` with `walk_grf.mot` and the
ExternalLoads file `walk_grf.xml`, a scaled model `scaled.osim`, and the same as users have theirs, `users.osim`
(`users_model`). Other trials, as `.trc` and `_grf.mot`: `other` (a
faster walk), `alike` (one that is nearly as fast), and with all ground contact measured (`synthetic_motions`) `long` (a
walk), `run` and `squats`. In C3D, with the markers of Plug-in Gait and the widths of knees and ankles: `static.c3d`
and `walk.c3d`. And without forces, with clusters of markers (`synthetic_clusters`): `clusters_static.trc` and
`clusters_walk.trc`.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from kinertia.io.c3d.writer import write_c3d
from kinertia.io.opensim.writer import export_osim
from kinertia.io.text.sto import write_sto
from kinertia.io.text.trc import write_trc
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.gait27 import build_gait27
from kinertia.model.skeleton import Marker, Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.synthetic.laboratory import LabNoise, LabRecordings, force_table, record
from kinertia.synthetic.walk import (
    HEIGHT_M,
    MASS_KG,
    SEX,
    Manner,
    SyntheticSubject,
    unlike_literature,
    walk,
    walking_subject,
    without_products,
)
from kinertia.trial.data import Markers, Recording
from synthetic_clusters import STATIC_ONLY, with_clusters
from synthetic_motions import long_walk, run, squats
from users_model import users_model
from validation.osim_models import Person

DURATION_S, PLATE_RATE_HZ, START, SAMPLES_PER_FRAME = 2.7, 1000.0, 0.75, 10
MARKER_DIAMETER_M = 0.014
_LOADS = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSimDocument Version="40000">
  <ExternalLoads name="loads">
    <objects>
{forces}
    </objects>
    <datafile>{file}</datafile>
  </ExternalLoads>
</OpenSimDocument>
"""
_FORCE = """      <ExternalForce name="{name}">
        <applied_to_body>{body}</applied_to_body>
        <force_expressed_in_body>ground</force_expressed_in_body>
        <point_expressed_in_body>ground</point_expressed_in_body>
        <force_identifier>{plate}_ground_force_v</force_identifier>
        <point_identifier>{plate}_ground_force_p</point_identifier>
        <torque_identifier>{plate}_ground_torque_</torque_identifier>
      </ExternalForce>"""


WITH_MODEL = Person("synthetic", MASS_KG, "users", {"walk": ("walk_grf", "walk_grf")})
"""The person with the user's model."""


def synthetic_arguments(folder: Path) -> list[str]:
    """Arguments of `kinertia fit` for `walk.trc` in the laboratory's folder."""
    walked, static = folder / "walk", folder / "static.trc"
    files = [f"{walked}.trc", "--forces", f"{walked}_grf.mot", "--loads", f"{walked}_grf.xml", "--static", str(static)]
    return [*files, "--mass", str(MASS_KG), "--height", str(HEIGHT_M), "--sex", SEX]


def write_synthetic_lab(folder: Path) -> Path:
    """Write all files into the folder; returns it."""
    truth, first, second, third, fourth, fifth, sixth, seventh = np.random.default_rng(100).spawn(8)
    person = unlike_literature(symmetric_person(), truth)
    recorded = _recorded(person, first)
    write_trc(folder / "static.trc", recorded.static.markers)
    _write_trial(folder, "walk", recorded.walk)
    _write_trial(folder, "other", _recorded(person, second, Manner(pace=1.1)).walk)
    _write_trial(folder, "alike", _recorded(person, seventh, Manner(pace=1.02)).walk)
    feet = _plate_feet(recorded)
    names = {"r": "right", "l": "left"}
    forces = [_FORCE.format(name=names[foot], body=f"foot_{foot}", plate=k) for k, foot in enumerate(feet, start=1)]
    (folder / "walk_grf.xml").write_text(_LOADS.format(forces="\n".join(forces), file="walk_grf.mot"), encoding="utf-8")
    export_osim(folder / "scaled.osim", person.skeleton, person.literature)
    export_osim(folder / "users.osim", *users_model(person.skeleton, person.literature))
    with_widths = _recorded(with_plug_in_gait(person), third)
    for name in ("static", "walk"):
        write_c3d(folder / f"{name}.c3d", getattr(with_widths, name))
    _write_trial(folder, "long", long_walk(person, _with_feet(person), fourth))
    _write_trial(folder, "run", run(person, fifth))
    _write_trial(folder, "squats", squats(person, sixth))
    _write_clusters(folder, person)
    return folder


def _write_clusters(folder: Path, person: SyntheticSubject) -> None:
    recorded = _recorded(with_clusters(person), np.random.default_rng(101))
    write_trc(folder / "clusters_static.trc", recorded.static.markers)
    walked = recorded.walk.markers
    write_trc(
        folder / "clusters_walk.trc", walked.select([label for label in walked.labels if label not in STATIC_ONLY])
    )


def _with_feet(person: SyntheticSubject) -> SyntheticSubject:
    """The walk shares loads out by markers of the feet."""
    return replace(person, skeleton=symmetric_person().skeleton)


def _recorded(person: SyntheticSubject, rng: np.random.Generator, manner: Manner | None = None) -> LabRecordings:
    trial = walk(_with_feet(person), DURATION_S, PLATE_RATE_HZ, START, manner=manner or Manner())
    trial = replace(trial, skeleton=person.moving_skeleton)
    recorded = record(person, trial, LabNoise(), rng, SAMPLES_PER_FRAME)
    widths = person.static.measurements
    return LabRecordings(*(replace(recording, measurements=widths) for recording in (recorded.static, recorded.walk)))


def _write_trial(folder: Path, name: str, recorded: Recording) -> None:
    assert recorded.plates is not None
    write_trc(folder / f"{name}.trc", recorded.markers)
    write_sto(folder / f"{name}_grf.mot", force_table(recorded.plates), False, f"{name}_grf")


def _plate_feet(recorded: LabRecordings) -> list[str]:
    """Which foot is on each plate, by the heel's side of the plate's centre."""
    plates, markers = recorded.walk.plates, recorded.walk.markers
    assert plates is not None
    assert plates.corners is not None
    feet = []
    for p, corners in enumerate(plates.corners):
        middle = plates.time[plates.force[:, p, 1] > 50.0].mean()
        frame = int(np.argmin(np.abs(markers.time - middle)))
        away = {side: markers.positions[frame, markers.labels.index(f"{side.upper()}.Heel")] for side in "rl"}
        feet.append(min(away, key=lambda side: float(np.linalg.norm((away[side] - corners.mean(axis=0))[[0, 2]]))))
    return feet


@cache
def symmetric_person() -> SyntheticSubject:
    """The package's walker with sides that mirror each other, as those of scaled models do."""
    person = walking_subject()
    markers = person.static.markers
    other = {"R": "L", "L": "R"}
    mirrored = [
        markers.labels.index(other.get(label[0], label[0]) + label[1:] if label[1] == "." else label)
        for label in markers.labels
    ]
    positions = (markers.positions + markers.positions[:, mirrored] * [1.0, 1.0, -1.0]) / 2.0
    static = replace(person.static, markers=replace(markers, positions=positions))
    model = build_gait27(static, person.marker_set, HEIGHT_M, SEX)
    literature = literature_bsp(MASS_KG, HEIGHT_M, SEX, model.geometry)
    return replace(
        person, static=static, skeleton=model.skeleton, literature=literature, bsp=without_products(literature)
    )


def with_plug_in_gait(person: SyntheticSubject) -> SyntheticSubject:
    """The same person with the markers of Plug-in Gait, and the widths of knees and ankles by calliper."""
    markers = person.static.markers
    q = solve_ik(person.skeleton, markers).q[:1]
    skeleton = person.skeleton.with_markers(_plug_in_gait(person.skeleton))
    places = np.repeat(skeleton.marker_positions(skeleton.pose(q)), len(markers.time), axis=0)
    widths = {
        f"{side}{joint}Width": float(
            np.linalg.norm(np.subtract(*(_at(person.skeleton, f"{side}.{joint}.{end}") for end in ("Lat", "Med"))))
            - MARKER_DIAMETER_M
        )
        for side in "RL"
        for joint in ("Knee", "Ankle")
    }
    static = Recording("static", Markers(markers.time, skeleton.labels, places), measurements=widths)
    return replace(person, static=static, skeleton=skeleton)


def _at(skeleton: Skeleton, label: str) -> np.ndarray:
    return next(marker.position for marker in skeleton.markers if marker.label == label)


def _plug_in_gait(skeleton: Skeleton) -> list[Marker]:
    """Where the set's markers are on the segments (m; X forward, Y up, Z right), by those of the Cleveland Clinic."""

    def beside(label: str, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
        return _at(skeleton, label) + np.array([x, y, z])

    places = {
        "C7": ("torso", beside("Sternum", -0.16, 0.09, 0.0)),
        "T10": ("torso", beside("Sternum", -0.19, -0.15, 0.0)),
        "CLAV": ("torso", beside("Sternum", 0.0, 0.03, 0.0)),
        "STRN": ("torso", beside("Sternum", 0.03, -0.14, 0.0)),
        "RBAK": ("torso", beside("Sternum", -0.19, -0.05, 0.09)),
    }
    for side, sign in (("R", 1.0), ("L", -1.0)):
        letter = side.lower()
        places |= {
            f"{side}FHD": ("torso", beside(f"{side}.Temple")),
            f"{side}BHD": ("torso", beside(f"{side}.Temple", x=-0.15)),
            f"{side}SHO": ("torso", beside(f"{side}.Acromium")),
            f"{side}ELB": (f"upper_arm_{letter}", beside(f"{side}.Elbow")),
            f"{side}WRA": (f"forearm_{letter}", beside(f"{side}.Wrist.Med")),
            f"{side}WRB": (f"forearm_{letter}", beside(f"{side}.Wrist.Lat")),
            f"{side}FIN": (f"forearm_{letter}", beside(f"{side}.Wrist.Lat", x=0.03 * sign, y=-0.08 - 0.02 * sign)),
            f"{side}ASI": ("pelvis", beside(f"{side}.ASIS")),
            f"{side}PSI": ("pelvis", beside("V.Sacral", z=0.045 * sign)),
            f"{side}THI": (f"thigh_{letter}", beside(f"{side}.Knee.Lat", y=0.18, z=0.02 * sign)),
            f"{side}KNE": (f"thigh_{letter}", beside(f"{side}.Knee.Lat")),
            f"{side}TIB": (f"shank_{letter}", beside(f"{side}.Ankle.Lat", y=0.16, z=0.02 * sign)),
            f"{side}ANK": (f"shank_{letter}", beside(f"{side}.Ankle.Lat")),
            f"{side}HEE": (f"foot_{letter}", beside(f"{side}.Heel")),
            f"{side}TOE": (f"foot_{letter}", (beside(f"{side}.Toe.Med") + beside(f"{side}.Toe.Lat")) / 2.0),
        }
    return [Marker(label, segment, place) for label, (segment, place) in places.items()]
