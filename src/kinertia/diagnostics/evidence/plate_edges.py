"""What lies beyond the edges of the plates: centres of pressure, and parts of feet, whose load no plate measures."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.evidence.plate_contacts import FAR_M, PlateContact
from kinertia.trial.data import FEET, FloatArray, Markers, PlateLoads
from kinertia.trial.sampled_time import within

OVERHANG_M = 0.01
"""Markers stand off the skin by as much."""
_TOE_M = 0.05
"""Nothing but toes is so short."""
_LOW_M = 0.03
"""A marker so near to where it is lowest during a contact is on the ground, not landing or lifted."""


class Overhang(NamedTuple):
    """A foot that stands on a plate and reaches beyond it.

    Attributes:
        plate, foot: index of the plate; 0 right, 1 left.
        overhang_m: of the marker that is farthest out.
        span_s: first and last time at which a marker is out while it is on the ground.
        only_toe: whether nothing but a toe is out.
    """

    plate: int
    foot: int
    overhang_m: float
    span_s: tuple[float, float]
    only_toe: bool


def beyond_edges(corners: FloatArray, place: FloatArray) -> FloatArray:
    """(...) m, how far horizontal places (..., 2) are beyond the edges of a plate (4, 3); negative on the plate."""
    flat = corners[:, [0, 2]]
    edges = np.roll(flat, -1, axis=0) - flat
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    normals *= np.sign(np.einsum("ek,ek->e", normals, flat - flat.mean(axis=0)))[:, None]  # outwards
    result: FloatArray = np.max(np.einsum("ek,...ek->...e", normals, place[..., None, :] - flat), axis=-1)
    return result


def overhangs(
    plates: PlateLoads,
    contacts: Sequence[PlateContact],
    markers: Markers,
    feet: Mapping[str, Sequence[str]],
    toes: Collection[str],
) -> list[Overhang]:
    """Feet that stand on a plate, under its load, and reach beyond its edge onto no other plate.

    Args:
        plates: with corners; nothing is known without.
        contacts: loads on them.
        markers: of the motion.
        feet: labels of the markers on each foot, "r" and "l".
        toes: labels of markers on toes.
    """
    found = []
    for contact in contacts:
        # where the load is not under the foot, the plate is not where its corners are
        if plates.corners is None or contact.distance_m > FAR_M / 2 or contact.in_turn or contact.between:
            continue
        labels = [label for label in feet[FEET[contact.foot]] if label in markers.labels]
        inside = within(markers.time, contact.time[0], contact.time[-1])
        place = markers.select(labels).positions[inside]
        seen = np.isfinite(place).all(axis=2)
        if not seen.any():
            continue
        height = np.where(seen, place[..., 1], np.inf)
        low = height < height.min(axis=0) + _LOW_M
        each = np.stack([beyond_edges(corners, place[..., [0, 2]]) for corners in plates.corners])
        out = low & (each.min(axis=0) > OVERHANG_M)
        usual = np.array([np.median(each.min(axis=0)[on, k]) if on.any() else -np.inf for k, on in enumerate(low.T)])
        far = usual > OVERHANG_M
        on_plate = (each[contact.plate] < 0.0) & low
        if not far.any() or not on_plate.any():
            continue
        more = far & (np.array([label not in toes for label in labels]) | (usual > _TOE_M))
        rows = np.flatnonzero((out & (more if more.any() else far)).any(axis=1))
        time = markers.time[inside][rows]
        span_s = (float(time[0]), float(time[-1]))
        farthest = float(usual.max())
        found.append(Overhang(contact.plate, contact.foot, farthest, span_s, not bool(more.any())))
    return found
