"""Holds a model that was read from a file: its skeleton, masses, and what is needed to write it back."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from kinertia.errors import OsimError
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.coordinate_map import AxisFunction
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.trial.data import Markers


@dataclass(frozen=True)
class OsimCoordinate:
    """A coordinate as defined in the file, in rad or m.

    Attributes:
        name, joint: names.
        default: its default value.
        range: smallest and largest value.
        clamped: whether OpenSim keeps it in its range.
        locked: whether OpenSim fixes it at its default.
        angle: whether motion files give it in degrees; False for lengths and for OpenSim's "coupled" coordinates, which
            move axes by curves only and stay in rad or m.
    """

    name: str
    joint: str
    default: float
    range: tuple[float, float]
    clamped: bool
    locked: bool
    angle: bool


@dataclass(frozen=True)
class OsimJoint:
    """A joint as defined in the file.

    Attributes:
        name: its name.
        coordinates: in the file's order.
        offset: byte span, in the file, of the element whose translation moves the joint in its parent's own axes; None
            if there is none.
    """

    name: str
    coordinates: tuple[OsimCoordinate, ...]
    offset: tuple[int, int] | None


@dataclass(frozen=True)
class Coupling:
    """A coordinate that depends on another by a CoordinateCouplerConstraint."""

    dependent: str
    independent: str
    function: AxisFunction


@dataclass(frozen=True, eq=False)
class OsimModel:
    """A model file as Kinertia represents it.

    Attributes:
        path, content: the file and its bytes.
        skeleton: locked coordinates at their defaults; coupled coordinates depend on their independent ones.
        bsp: of all bodies, in the file's order; a body may be massless.
        joints: in the skeleton's order.
        couplings: dependent coordinates, which are not in the skeleton.
        marker_frames: per label, (3, 3) orientation of the frame in which its location is given, in its body.

    Examples:
        >>> model = kinertia.read_osim("model.osim")  # as `kinertia demo` writes it
        >>> len(model.coordinates), model.skeleton.segments[0]
        (27, 'pelvis')
    """

    path: Path
    content: bytes = field(repr=False)
    skeleton: Skeleton
    bsp: BodySegmentParameters
    joints: tuple[OsimJoint, ...]
    couplings: tuple[Coupling, ...]
    marker_frames: Mapping[str, np.ndarray]

    @cached_property
    def coordinates(self) -> tuple[OsimCoordinate, ...]:
        """All coordinates of the file, joint by joint."""
        return tuple(coordinate for joint in self.joints for coordinate in joint.coordinates)

    def all_coordinates(self, skeleton: Skeleton, q: np.ndarray) -> np.ndarray:
        """Return values (n, k) of all `coordinates`, including locked and coupled ones.

        Args:
            skeleton: the model's, possibly with more coordinates locked.
            q: (n, c) its coordinates.
        """
        known = {name: q[:, i] for i, name in enumerate(skeleton.coordinates)}
        known |= {name: np.full(len(q), value) for name, value in skeleton.locked.items()}
        for coupling in self.couplings:
            known[coupling.dependent] = coupling.function(known[coupling.independent])
        return np.stack([known[coordinate.name] for coordinate in self.coordinates], axis=1)


def markers_of_model(model: OsimModel) -> MarkerSet:
    """Return the marker set of an OpenSim model, by segment and in its default pose.

    It has no landmarks, since no model is built from it.

    Raises:
        OsimError: the model has no markers.
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
