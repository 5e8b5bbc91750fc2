"""Make walks of known truth by OpenSim alone.

Walks with known body segment parameters and joint moments, made by OpenSim alone (only file writers are ours).

A measured walk gives the motion: OpenSim's inverse kinematics, fitted by splines. A person unlike the model walks it:
every body's mass, centre of mass and inertia are perturbed, and OpenSim's inverse dynamics says which ground reactions
that takes; the feet share them as the measured forces did. The markers slide over the skin with the joint angles.

FOLDER receives what a laboratory would hand over (model.osim, walk.trc, walk_grf.mot, loads.xml) and, in FOLDER/truth,
what nobody could measure (model.osim, motion.mot, forces.mot, loads.xml, moments.sto, truth.json).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import opensim
import pandas as pd
from scipy.interpolate import BSpline

from kinertia.io.text.sto import read_sto, write_sto
from kinertia.io.text.trc import read_trc, write_trc
from kinertia.trial.data import Markers
from validation.measured_data import data_folder
from validation.measured_skin import MeasuredSkin, on_measured_skin
from validation.opensim_runs import inverse_dynamics, inverse_kinematics, quietly, radians, vector
from validation.truth_person import SIDES, Person, array

KNOTS_HZ = 8.0
EDGE_S = 0.15
"""Time left out at both ends: a spline's ends are not gait."""
MARKERS_HZ, FORCES_HZ = 100.0, 500.0
SKIN_M = {"femur": 0.006, "tibia": 0.004, "torso": 0.004, "pelvis": 0.004}
"""How far markers slide (standard deviation), per body; those of other bodies by OTHER_SKIN_M."""
OTHER_SKIN_M, CAMERA_M = 0.0025, 0.0003
LIGHT_KG = 0.5
"""Bodies below this weight stay as they are."""


@dataclass(frozen=True)
class Faults:
    """Faults of the laboratory, and of the exported model."""

    plate_m: float = 0.0
    """The left plate reports the centre of pressure this far forward."""
    lag_s: float = 0.0
    """The forces are late by this."""
    hip_m: float = 0.0
    """The model's hip centres are off by this, forward and outward."""


@dataclass(frozen=True)
class Source:
    """The walk and the model that a truth trial starts from."""

    model: Path
    markers: Path
    forces: Path
    span_s: tuple[float, float] = (0.0, 2.4)


def gait2354() -> Source:
    """Return the walk that comes with OpenSim's gait2354."""
    data = data_folder() / "gait2354"
    return Source(data / "subject01_scaled.osim", data / "subject01_walk1.trc", data / "subject01_walk1_grf.mot")


class Spline:
    """Quintic spline through the coordinates of a motion, with knots at KNOTS_HZ twice per period."""

    def __init__(self, time: np.ndarray, values: np.ndarray) -> None:
        self.start, self.end = float(time[0]), float(time[-1])
        basis = self._basis(time)[0]
        normal = basis.T @ basis + 1e-6 * np.eye(basis.shape[1])
        self.weights = np.linalg.solve(normal, basis.T @ values)

    def __call__(self, time: np.ndarray) -> list[np.ndarray]:
        """Return values, first and second derivatives at the given times."""
        return [basis @ self.weights for basis in self._basis(time)]

    def times(self, rate_hz: float) -> np.ndarray:
        """Return sample times between the ends that are left out."""
        return np.arange(self.start + EDGE_S, self.end - EDGE_S, 1 / rate_hz)

    def _basis(self, time: np.ndarray, degree: int = 5) -> list[np.ndarray]:
        spans = int(np.ceil((self.end - self.start) * 2 * KNOTS_HZ))
        knots = np.linspace(self.start, self.end, spans + 1)
        beyond = (knots[1] - knots[0]) * np.arange(1, degree + 1)
        knots = np.concatenate([self.start - beyond[::-1], knots, self.end + beyond])
        spline = BSpline(knots, np.eye(len(knots) - degree - 1), degree)
        return [spline(time, nu=order) for order in range(3)]


def is_sided(body: str) -> bool:
    """Return whether a body is one of a pair."""
    return body.endswith(("_r", "_l"))


def perturbed(model: opensim.Model, rng: np.random.Generator) -> dict[str, dict[str, Any]]:
    """Give the model another person's body segment parameters, the left about equal to the right, and return them."""
    true, deviations = {}, {}
    for k in range(model.getBodySet().getSize()):
        body = model.getBodySet().get(k)
        kind = body.getName()[:-2] if is_sided(body.getName()) else body.getName()
        if kind not in deviations:
            deviations[kind] = (
                np.exp(0.12 * rng.standard_normal()),
                0.012 * rng.standard_normal(3),
                np.exp(0.10 * rng.standard_normal(3)),
            )
        mass_factor, com, inertia_factor = deviations[kind]
        mass_factor = mass_factor * (1 + 0.02 * rng.standard_normal())
        if body.getMass() >= LIGHT_KG:
            com = com * [1, 1, -1 if body.getName().endswith("_l") else 1]
            perturb(body, mass_factor, com, inertia_factor)
        true[body.getName()] = {"mass": body.getMass(), "com": array(body.getMassCenter()).tolist()}
        true[body.getName()]["inertia"] = inertia(body).tolist()
    return true


def inertia(body: opensim.Body) -> np.ndarray:
    """Return the inertia tensor about the centre of mass."""
    (xx, yy, zz), (xy, xz, yz) = array(body.getInertia().getMoments()), array(body.getInertia().getProducts())
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def perturb(body: opensim.Body, mass_factor: float, com: np.ndarray, inertia_factor: np.ndarray) -> None:
    """Change one body; scaling its second moments of mass keeps the inertia physically possible."""
    old = inertia(body)
    second = 0.5 * np.trace(old) * np.eye(3) - old
    scale = np.diag(np.sqrt(inertia_factor))
    second = scale @ second @ scale * mass_factor
    new = np.trace(second) * np.eye(3) - second
    body.setMass(body.getMass() * mass_factor)
    body.setMassCenter(vector(array(body.getMassCenter()) + com))
    body.setInertia(opensim.Inertia(new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[0, 2], new[1, 2]))


def right_share(measured: pd.DataFrame, time: np.ndarray, right: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Return the right foot's share of the load, from the vertical forces of two measured plates.

    Args:
        measured: the forces file.
        time: (n,) times of the share.
        right: (n, 3) a point of the right foot.
        left: (n, 3) a point of the left foot.
    """
    first, second = (
        np.interp(time, measured.index, measured[column].clip(lower=0)) for column in _columns(measured, "vy")
    )
    share = first / np.maximum(first + second, 1e-9)
    pressure = np.column_stack(
        [np.interp(time, measured.index, measured[_columns(measured, axis)[0]]) for axis in ("px", "pz")]
    )
    loaded = first > 200
    far_right, far_left = (
        np.linalg.norm(pressure[loaded] - foot[loaded][:, [0, 2]], axis=1).mean() for foot in (right, left)
    )
    share = share if far_right < far_left else 1 - share
    return np.where(share < 0.02, 0, np.where(share > 0.98, 1, share))


def _columns(measured: pd.DataFrame, ending: str) -> list[str]:
    return [column for column in measured.columns if column.endswith(ending)][:2]


def plate_row(wrench: np.ndarray, share: dict[str, float], points: dict[str, np.ndarray]) -> dict[str, float]:
    """Return force, centre of pressure and free moment per foot that together give the wrench at the ground origin."""
    row = dict.fromkeys(force_columns(), 0.0)
    force, moment = wrench[:3], wrench[3:]
    below = {side: points[side] * [1, 0, 1] for side in SIDES}
    rest = moment - sum(np.cross(below[side], share[side] * force) for side in SIDES)
    for side in SIDES:
        if share[side] == 0:
            continue
        part, turning = share[side] * force, share[side] * rest
        shift = np.array([turning[2], 0, -turning[0]]) / part[1] if abs(part[1]) > 1 else np.zeros(3)
        free = turning - np.cross(shift, part)
        for axis, f, p in zip("xyz", part, below[side] + shift, strict=True):
            row[f"ground_force_{side}_v{axis}"], row[f"ground_force_{side}_p{axis}"] = f, p
        row[f"ground_torque_{side}_y"] = free[1]
    return row


def force_columns() -> list[str]:
    """Return the columns of the forces file."""
    return [
        f"ground_{kind}{axis}"
        for side in SIDES
        for kind in (f"force_{side}_v", f"force_{side}_p", f"torque_{side}_")
        for axis in "xyz"
    ]


def ground_reactions(person: Person, motion: Spline, measured: pd.DataFrame) -> pd.DataFrame:
    """Compute the forces file of fault-free instruments."""
    time = motion.times(FORCES_HZ)
    wrenches, points = [], []
    for q, qd, qdd in zip(*motion(time), strict=True):
        wrenches.append(person.ground_wrench(q, qd, qdd))
        person.pose(q)
        points.append(person.foot_points())
    right, left = (np.array([point[side] for point in points]) for side in SIDES)
    share = right_share(measured, time, right, left)
    rows = [
        plate_row(wrench, {"r": part, "l": 1 - part}, feet)
        for wrench, part, feet in zip(wrenches, share, points, strict=True)
    ]
    return pd.DataFrame(rows, pd.Index(time, name="time"), force_columns())


def disturbed(forces: pd.DataFrame, faults: Faults) -> pd.DataFrame:
    """Return the forces as faulty instruments report them."""
    forces = forces.copy()
    forces["ground_force_l_px"] += faults.plate_m * (forces["ground_force_l_vy"] != 0)
    forces.index = forces.index + faults.lag_s
    return forces


def markers_on_skin(person: Person, motion: Spline, names: Sequence[str], rng: np.random.Generator) -> Markers:
    """Simulate markers that slide on their bodies, linearly in two nearby joint angles, seen by noisy cameras."""
    time = motion.times(MARKERS_HZ)
    q = motion(time)[0]
    seen = []
    for pose in q:
        person.pose(pose)
        seen.append([person.marker(name) for name in names])
    joints = [
        k for k, coordinate in enumerate(person.coordinates)
        if coordinate.getMotionType() == 1 and k not in person.root
    ]  # fmt: skip
    angles = q[:, joints] - q[:, joints].mean(axis=0)
    angles /= np.maximum(angles.std(axis=0), 1e-3)
    positions = np.array([[place for place, _ in frame] for frame in seen])
    for m, name in enumerate(names):
        body = person.model.getMarkerSet().get(name).getParentFrame().getName()
        near = [j for j, k in enumerate(joints) if person.names[k].endswith(body[-2:]) or not is_sided(body)]
        picked = rng.choice(near or range(len(joints)), size=min(2, len(near or joints)), replace=False)
        slide = sum(angles[:, [j]] * rng.standard_normal(3) for j in picked) / np.sqrt(len(picked))
        slide = slide * SKIN_M.get(body.split("_")[0], OTHER_SKIN_M)
        slide = slide + CAMERA_M * rng.standard_normal((len(time), 3))
        positions[:, m] += np.einsum("tij,tj->ti", [frame[m][1] for frame in seen], slide)
    return Markers(time, tuple(names), positions)


def write_loads(path: Path, forces: str) -> None:
    """Write the ExternalLoads file for a forces file of `force_columns`."""
    template = """<ExternalForce name="{name}"><applied_to_body>calcn_{side}</applied_to_body>
      <force_expressed_in_body>ground</force_expressed_in_body><point_expressed_in_body>ground</point_expressed_in_body>
      <force_identifier>ground_force_{side}_v</force_identifier>
      <point_identifier>ground_force_{side}_p</point_identifier>
      <torque_identifier>ground_torque_{side}_</torque_identifier></ExternalForce>"""
    both_forces = "\n      ".join(template.format(name=name, side=name[0]) for name in ("right", "left"))
    path.write_text(
        f"""<?xml version="1.0" encoding="UTF-8"?>
<OpenSimDocument Version="40000">
  <ExternalLoads name="loads">
    <objects>
      {both_forces}
    </objects>
    <datafile>{forces}</datafile>
  </ExternalLoads>
</OpenSimDocument>
""",
        encoding="utf-8",
    )


def write_model(source: Path, path: Path, hip_m: float) -> None:
    """Write the exported model, with its hip centres displaced."""
    model = opensim.Model(str(source))
    model.initSystem()
    shift = hip_m / np.sqrt(2)
    for side, outward in zip(SIDES, (1, -1), strict=True):
        frame = opensim.PhysicalOffsetFrame.safeDownCast(model.updJointSet().get(f"hip_{side}").upd_frames(0))
        frame.set_translation(vector(array(frame.get_translation()) + np.array([shift, 0, outward * shift])))
    model.finalizeConnections()
    model.printToXML(str(path))


def write_truth(person: Person, motion: Spline, forces: pd.DataFrame, bodies: dict[str, Any], folder: Path) -> None:
    """Write what cannot be measured: the true model, motion, forces and joint moments."""
    time = motion.times(MARKERS_HZ)
    write_sto(folder / "motion.mot", pd.DataFrame(motion(time)[0], pd.Index(time), person.names), False, "motion")
    write_sto(folder / "forces.mot", forces, False, "forces")
    write_loads(folder / "loads.xml", "forces.mot")
    person.model.printToXML(str(folder / "model.osim"))
    inverse_dynamics(folder / "model.osim", folder / "motion.mot", folder / "loads.xml", folder / "moments.sto")
    total = sum(body["mass"] for body in bodies.values())
    (folder / "truth.json").write_text(json.dumps({"bodies": bodies, "total_mass_kg": total}, indent=1))


def make_trial(folder: Path, seed: int, faults: Faults, source: Source, skin: MeasuredSkin | None = None) -> None:
    """Write one truth trial; markers of thighs and shanks move with measured skin if there is one."""
    (folder / "truth").mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    with quietly(folder / "opensim.log"):
        model = opensim.Model(str(source.model))
        for actuators in (model.updForceSet(), model.updControllerSet()):
            actuators.clearAndDestroy()
        model.finalizeConnections()
        model.initSystem()
        inverse_kinematics(model, source.markers, folder / "truth" / "ik.mot", span_s=source.span_s)
        q = radians(model, folder / "truth" / "ik.mot")
        motion = Spline(q.index.to_numpy(), q.to_numpy())
        bodies = perturbed(model, rng)
        person = Person(model)
        forces = ground_reactions(person, motion, read_sto(source.forces))
        there = read_trc(source.markers).labels
        markers = model.getMarkerSet()
        names = [name for name in (markers.get(k).getName() for k in range(markers.getSize())) if name in there]
        seen = markers_on_skin(person, motion, names, rng)
        if skin is not None:
            seen = on_measured_skin(seen, person, motion(seen.time)[0], forces, skin, seed)
        write_trc(folder / "walk.trc", seen)
        write_model(source.model, folder / "model.osim", faults.hip_m)
        write_truth(person, motion, forces, bodies, folder / "truth")
    write_sto(folder / "walk_grf.mot", disturbed(forces, faults), False, "walk_grf")
    write_loads(folder / "loads.xml", "walk_grf.mot")


def main(folder: Path, seed: int = 100, plate_mm: float = 0.0, lag_ms: float = 0.0, hip_mm: float = 0.0) -> None:
    """Make one trial in this folder from the gait2354 walk."""
    make_trial(folder, seed, Faults(plate_mm / 1e3, lag_ms / 1e3, hip_mm / 1e3), gait2354())
