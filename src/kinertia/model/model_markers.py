"""Assigns the markers of an OpenSim model to segments."""

from __future__ import annotations

import numpy as np

from kinertia.errors import OsimError
from kinertia.model.anatomy import segment_of
from kinertia.model.imported_model import OsimModel
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers


def markers_of_model(model: OsimModel) -> MarkerSet:
    """The markers of an OpenSim model, by segment and in its default pose; without landmarks: no model is built.

    Raises:
        OsimError: there are none.
    """
    markers = model.skeleton.markers
    if not markers:
        raise OsimError.found(model.path, "O106")
    owners = {marker.label: segment_of(marker.segment) or marker.segment for marker in markers}
    names = dict.fromkeys(("foot_r", "foot_l", *owners.values()))
    segments = {name: tuple(label for label, owner in owners.items() if owner == name) for name in names}
    skeleton, defaults = model.skeleton, {c.name: c.default for c in model.coordinates}
    q = np.array([[defaults[name] for name in skeleton.coordinates]])
    places = Markers(np.zeros(1), skeleton.labels, skeleton.marker_positions(skeleton.pose(q)))
    return MarkerSet(model.path.name, {}, segments, {}, places)
