"""Which marker of an OpenSim model is on which segment."""

from __future__ import annotations

from kinertia.errors import OsimError
from kinertia.model.anatomy import segment_of
from kinertia.model.imported import OsimModel
from kinertia.model.marker_set import MarkerSet


def markers_of_model(model: OsimModel) -> MarkerSet:
    """The markers of an OpenSim model by segment, without landmarks: no model is built from them.

    Raises:
        OsimError: there are none.
    """
    markers = model.skeleton.markers
    if not markers:
        raise OsimError(model.path, "no markers in it; scale the model with OpenSim's Scale tool, which places them")
    owners = {marker.label: segment_of(marker.segment) or marker.segment for marker in markers}
    names = dict.fromkeys(("foot_r", "foot_l", *owners.values()))
    segments = {name: tuple(label for label, owner in owners.items() if owner == name) for name in names}
    return MarkerSet(model.path.name, {}, segments, {})
