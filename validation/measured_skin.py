"""Skin motion measured on a person, carried over to the thighs and shanks of walks of known truth.

The file is a NumPy archive of one donor: `NAME_moved` (n, m, 3) m, how far markers moved over the bone in whole strides
of STRIDE_FRAMES from heel strike to heel strike, mean removed; `NAME_place` (m, 3) m, where they are; `NAME_segment`
(m,) "thigh" or "shank"; `NAME_stature` m. Axes are the bone's: x forward, y up, z outward; origin at the knee. Such
recordings are published (Cereatti et al. 2017, J Biomech, doi 10.1016/j.jbiomech.2017.02.004) and none comes with
Kinertia.

A model's marker takes the curve of the donor's nearest one, in shares of the segment's length, after a random shift
of its place by PLACE_SD_M, so that people differ. The donor's strides follow each other as they were measured, from a
stride drawn for each leg. The left leg is the mirror image, with curves of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import pandas as pd

from kinertia.trial.data import Markers
from validation.opensim_runs import vector
from validation.truth_person import SIDES, Person, array

STRIDE_FRAMES = 150
PLACE_SD_M = 0.020
CAMERA_M = 0.0003
LOADED_N = 20.0
_FEMUR_OF_STATURE = 0.245
"""Drillis and Contini (1966)."""
_SEGMENTS = {"femur": "thigh", "tibia": "shank"}
_STREAM = 77
"""Skin is drawn apart from the person: the same with and without it."""


@dataclass(frozen=True, eq=False)
class MeasuredSkin:
    """Displacements of one donor's skin markers.

    Attributes:
        moved: (n, m, 3) m displacements.
        places: (m, 3) positions over the length of the donor's femur.
        segments: (m,) "thigh" or "shank".
    """

    moved: np.ndarray
    places: np.ndarray
    segments: np.ndarray

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the only donor of a file, or its first."""
        with np.load(path) as file:
            name = next(key for key in file if key.endswith("_moved")).removesuffix("_moved")
            moved, places, segments, stature = (file[f"{name}_{k}"] for k in ("moved", "place", "segment", "stature"))
        return cls(moved.astype(float), places / (_FEMUR_OF_STATURE * float(stature)), segments)

    @property
    def strides(self) -> int:
        """Number of whole strides."""
        return len(self.moved) // STRIDE_FRAMES

    def curves(self, segment: str, places: np.ndarray) -> list[int]:
        """Choose the donor's marker for each of these (k, 3) positions in femur lengths; none twice if possible."""
        every = [int(j) for j in np.flatnonzero(self.segments == segment)]
        picked: list[int] = []
        for place in places:
            free = [j for j in every if j not in picked] or every
            picked.append(min(free, key=lambda j: float(np.linalg.norm(self.places[j] - place))))
        return picked

    def at(self, strides: np.ndarray, curves: Sequence[int]) -> np.ndarray:
        """Return displacements (n, k, 3) m on these curves, so many strides (n,) after the beginning."""
        loop = np.concatenate([self.moved, self.moved[:1]])[:, curves].reshape(len(self.moved) + 1, -1)
        frames = strides % self.strides * STRIDE_FRAMES
        values = [np.interp(frames, np.arange(len(loop)), column) for column in loop.T]
        result = np.column_stack(values)
        return (result - result.mean(axis=0)).reshape(len(strides), len(curves), 3)


def heel_strikes_s(forces: pd.DataFrame, side: str) -> np.ndarray:
    """Return the times at which a foot's vertical force passes LOADED_N."""
    loaded = (forces[f"ground_force_{side}_vy"] > LOADED_N).to_numpy()
    return forces.index.to_numpy()[np.flatnonzero(loaded[1:] & ~loaded[:-1]) + 1]


def stride_s(forces: pd.DataFrame) -> float:
    """Return the mean stride time (s) of both sides."""
    return float(np.mean(np.concatenate([np.diff(heel_strikes_s(forces, side)) for side in SIDES])))


def strides_since(time: np.ndarray, strikes: np.ndarray, each_s: float) -> np.ndarray:
    """Return strides since the first of these heel strikes, before and after them at the usual pace."""
    before, after = each_s * np.arange(4, 0, -1), each_s * np.arange(1, 5)
    edges = np.concatenate([strikes[0] - before, strikes, strikes[-1] + after])
    return np.interp(time, edges, np.arange(len(edges)) - len(before))


def on_measured_skin(
    markers: Markers, person: Person, q: np.ndarray, forces: pd.DataFrame, skin: MeasuredSkin, seed: int
) -> Markers:
    """Move the markers of thighs and shanks with measured skin motion.

    Args:
        markers: markers at (n,) times.
        person: person whose model determines marker positions.
        q: (n, c) true coordinates.
        forces: forces of fault-free instruments.
        skin: displacements of the donor.
        seed: seed of the person.
    """
    rng, positions = np.random.default_rng([seed, _STREAM]), markers.positions.copy()
    known, pace_s = person.model.getMarkerSet(), stride_s(forces)
    bodies = {name: known.get(name).getParentFrame().getName() for name in markers.labels}
    person.pose(q[0])
    knees = {side: _knee(person, side) for side in SIDES}
    femur_m = float(np.mean([np.linalg.norm(knee) for knee in knees.values()]))
    for side in SIDES:
        begins = rng.integers(skin.strides)
        strides = strides_since(markers.time, heel_strikes_s(forces, side), pace_s) + begins
        outward = np.array([1.0, 1.0, 1.0 if side == "r" else -1.0])
        for bone, segment in _SEGMENTS.items():
            names = [name for name, body in bodies.items() if body == f"{bone}_{side}"]
            local = np.array([array(known.get(name).get_location()) for name in names])
            from_knee = (local - knees[side] * [0, bone == "femur", 0]) * outward / femur_m
            drawn = from_knee + rng.normal(0.0, PLACE_SD_M, local.shape) / femur_m
            moved = skin.at(strides, skin.curves(segment, drawn)) * outward
            moved += CAMERA_M * rng.standard_normal(moved.shape)
            columns = [markers.labels.index(name) for name in names]
            positions[:, columns] = _displaced(person, q, names, moved)
    return replace(markers, positions=positions)


def _knee(person: Person, side: str) -> np.ndarray:
    """Return the origin of the tibia in the femur."""
    bodies = person.model.getBodySet()
    femur, tibia = (bodies.get(f"{bone}_{side}") for bone in _SEGMENTS)
    return array(tibia.findStationLocationInAnotherFrame(person.state, vector([0, 0, 0]), femur))


def _displaced(person: Person, q: np.ndarray, names: Sequence[str], moved: np.ndarray) -> np.ndarray:
    """Return true marker positions plus displacements (n, k, 3) in the axes of their segment, as (n, k, 3) m."""
    result = np.empty_like(moved)
    for frame, pose in enumerate(q):
        person.pose(pose)
        for k, name in enumerate(names):
            place, turned = person.marker(name)
            result[frame, k] = place + turned @ moved[frame, k]
    return result
