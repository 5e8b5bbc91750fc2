"""Reads OpenSim model files (.osim, formats 3 and 4): bodies, joints, coordinates, markers as a `Skeleton`.

Muscles, wrapping, geometry and controllers are not read; `kinertia.io.opensim.writer` passes them through unchanged. An
element that cannot be represented raises an error that identifies it.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kinertia.errors import OsimError, expect_file
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.opensim.joints import Frames, JointElement, Values, coupled, read_joint, read_joint_in_body
from kinertia.io.opensim.xml import Element, XmlError, parse
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.coordinate_range import Range
from kinertia.model.imported_model import Coupling, OsimJoint, OsimModel
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton

NEWEST_VERSION = 40600
"""Newest known format; OpenSim 4.6 writes it."""
EARTHS_GRAVITY_M_S2 = (9.76, 9.84)
"""Range of gravity from high mountains at the equator to the poles."""
_START = 0.2
"""How far from its default to the middle of its range a coordinate starts.

An elbow that starts straight may bend either way: turned by half a turn, the arm fits its markers nearly as well.
"""
_FULL_TURN_SLACK_RAD = 0.02
"""Files have pi with few digits."""
_FORMAT_3, _FORMAT_4 = range(30000, 30501), range(40000, NEWEST_VERSION + 1)


def read_osim(path: str | Path) -> OsimModel:
    """Read an OpenSim model.

    Raises:
        FileError: no such file.
        OsimError: not an OpenSim model of a known format, or one that Kinertia cannot represent.
    """
    path = Path(path)
    expect_file(path)
    content = path.read_bytes()
    model, version = _model(path, content)
    defaults = model.child("defaults")
    values = Values(path, {e.tag: e for e in defaults.children} if defaults is not None else {})
    bodies = body_elements(model)
    bsp = _bsp(values, bodies)
    if version in _FORMAT_3:
        holders = [
            (joint, body) for body in bodies for holder in [body.child("Joint")] if holder for joint in holder.children
        ]
        frames = None
        joints = [read_joint_in_body(values, joint, body.name) for joint, body in holders]
    else:
        frames = Frames(values, model, bsp.segments)
        joints = [read_joint(values, element, frames) for element in _objects(model, "JointSet")]
    joints = _ordered(values, joints, bodies)
    couplings = _couplings(values, model, joints)
    placed = [_marker(values, element, frames, bsp.segments) for element in marker_elements(model)]
    _check_marker_names(values, marker_elements(model), [marker.segment for marker, _ in placed])
    markers = [marker for marker, _ in placed if marker.segment != "ground"]
    skeleton = _skeleton(values, model, joints, couplings, markers)
    if not bsp.mass_kg[bsp.segments.index(skeleton.segments[0])] > 0:
        root = next(body for body in bodies if body.name == skeleton.segments[0])
        values.fail(root, "the root has no mass, expected a positive one (kg), as of a pelvis", "O103")
    turned = {marker.label: rotation for marker, rotation in placed}
    return OsimModel(path, content, skeleton, bsp, tuple(_kept(joint) for joint in joints), couplings, turned)


def _model(path: Path, content: bytes) -> tuple[Element, int]:
    try:
        document = parse(content)
    except XmlError as error:
        raise _unknown(path, f"not XML ({error})", error.line) from None
    model = document.child("Model")
    if document.tag != "OpenSimDocument" or model is None:
        raise _unknown(path, f"no Model in it (outermost element <{document.tag}>)")
    stated = document.attributes.get("Version", "")
    version = int(stated) if re.fullmatch("[0-9]{1,9}", stated) else 0
    if version > NEWEST_VERSION:
        raise _unknown(path, f"{stated}, newer than {NEWEST_VERSION}, the newest known here", document.line)
    if version not in _FORMAT_3 and version not in _FORMAT_4:
        raise _unknown(path, f"'{stated}'", document.line)
    return model, version


def _unknown(path: Path, version: str, line: int | None = None) -> OsimError:
    return OsimError.found(path, "O101", line, version=Quantity(version))


def _objects(model: Element, tag: str) -> list[Element]:
    """Return the members of one of the model's sets."""
    model_set = model.child(tag)
    objects = None if model_set is None else model_set.child("objects")
    return [] if objects is None else objects.children


def body_elements(model: Element) -> list[Element]:
    """Return the bodies, without ground."""
    return [body for body in _objects(model, "BodySet") if body.tag == "Body" and body.name != "ground"]


def marker_elements(model: Element) -> list[Element]:
    """Return the marker elements."""
    return [marker for marker in _objects(model, "MarkerSet") if marker.tag == "Marker"]


INERTIA_TAGS = tuple(f"inertia_{axes}" for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
"""Format 3 has one element for each of what format 4 has in one, `inertia`."""


def _bsp(values: Values, bodies: Sequence[Element]) -> BodySegmentParameters:
    rows = []
    for body in bodies:
        mass = values.numbers(body, "mass", 1)
        if mass[0] < 0:
            values.fail(body, f"its mass is {mass[0]:g} kg, expected zero or a positive one", "O103")
        centre = values.numbers(body, "mass_center", 3, [0.0] * 3)
        if values.property(body, "inertia") is not None:
            inertia = values.numbers(body, "inertia", 6)
        else:
            inertia = np.concatenate([values.numbers(body, tag, 1) for tag in INERTIA_TAGS])
        # OpenSim's tensors are per kg: without mass there is none
        rows.append(np.concatenate([mass, centre, inertia * (mass > 0)]))
    return BodySegmentParameters.from_table(tuple(body.name for body in bodies), np.array(rows))


def _ordered(values: Values, joints: Sequence[JointElement], bodies: Sequence[Element]) -> list[JointElement]:
    """Order joints so that parents come before children, the root first."""
    names = {body.name for body in bodies}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in names and (end != "ground" or end == joint.child):
                values.fail(joint.element, f"it connects '{end}', which is not among the bodies", "O103")
    placed, left, ordered = {"ground"}, list(joints), []
    while left:
        ready = next((joint for joint in left if joint.parent in placed), None)
        if ready is None:
            values.fail(left[0].element, "it is in a chain that does not reach ground", "O103")
        if ready.child in placed:
            loop = f"it closes a loop at body '{ready.child}', expected a tree, one joint for each body"
            values.fail(ready.element, loop, "O103")
        left.remove(ready)
        placed.add(ready.child)
        ordered.append(ready)
    for body in bodies:
        if body.name not in placed:
            values.fail(body, "no joint connects it", "O103")
    return ordered


def _couplings(values: Values, model: Element, joints: Sequence[JointElement]) -> tuple[Coupling, ...]:
    """Return couplings in an order in which independent coordinates come before those that follow them."""
    names = {coordinate.name for joint in joints for coordinate in joint.coordinates}
    couplings = []
    for element in _objects(model, "ConstraintSet"):
        if values.flag(element, "isDisabled", False) or not values.flag(element, "isEnforced", True):
            continue
        if element.tag != "CoordinateCouplerConstraint":
            values.fail(
                element, "the only constraint supported is a CoordinateCouplerConstraint, set isEnforced to false"
            )
        leaders = values.text(element, "independent_coordinate_names").split()
        dependent = values.text(element, "dependent_coordinate_name")
        for name in (*leaders, dependent):
            if name not in names:
                values.fail(element, f"it names the coordinate '{name}', which no joint has")
        holder = element.child("coupled_coordinates_function")
        if len(leaders) != 1 or holder is None or not holder.children:
            values.fail(element, f"it has {len(leaders)} independent coordinates, expected one and a function")
        function = values.function(holder.children[0], element.name)
        scale = float(values.numbers(element, "scale_factor", 1, [1.0])[0])
        couplings.append((element, Coupling(dependent, leaders[0], function.scaled(scale))))
    return _leaders_first(values, couplings)


def _leaders_first(values: Values, couplings: Sequence[tuple[Element, Coupling]]) -> tuple[Coupling, ...]:
    left, ordered = list(couplings), []
    while left:
        following = {coupling.dependent for _, coupling in left}
        ready = next((item for item in left if item[1].independent not in following), None)
        if ready is None:
            values.fail(left[0][0], "it couples coordinates in a circle")
        left.remove(ready)
        ordered.append(ready[1])
    return tuple(ordered)


def _marker(
    values: Values, element: Element, frames: Frames | None, bodies: Sequence[str]
) -> tuple[Marker, np.ndarray]:
    """Read a marker in its body, and the orientation of its own frame there."""
    location = values.numbers(element, "location", 3, [0.0] * 3)
    if frames is None:
        body, rotation, origin = values.text(element, "body"), np.eye(3), np.zeros(3)
        if body not in (*bodies, "ground"):
            values.fail(element, f"it is on '{body}', which is not among the bodies", "O103")
    else:
        body, (rotation, origin) = frames.place(element, element.name, values.text(element, "socket_parent_frame"))
    return Marker(element.name, body, origin + rotation @ location), rotation


def _check_marker_names(values: Values, elements: Sequence[Element], bodies: Sequence[str]) -> None:
    """Check that every marker name is unique, since measured markers are identified by name."""
    first: dict[str, str] = {}
    for element, body in zip(elements, bodies, strict=True):
        if element.name in first:
            other = first[element.name]
            on = Quantity(body if other == body else f"{other} and {body}")
            stated = {"label": Quantity(element.name), "bodies": on}
            found = with_evidence("O105", Where(markers=(element.name,)), stated)
            raise OsimError.about(values.path, found, element.line)
        first[element.name] = body


def _skeleton(
    values: Values,
    model: Element,
    joints: Sequence[JointElement],
    couplings: Sequence[Coupling],
    markers: Sequence[Marker],
) -> Skeleton:
    gravity = values.numbers(model, "gravity", 3, [0.0, -9.80665, 0.0])
    low, high = EARTHS_GRAVITY_M_S2
    if gravity[0] or gravity[2] or not low <= -gravity[1] <= high:
        stated = {"gravity": Quantity(tuple(gravity.tolist()), "m/s2", usual=(-high, -low))}
        raise OsimError.about(values.path, with_evidence("O104", Where(), stated), model.line)
    locked: dict[str, float] = {}
    following = {coupling.dependent for coupling in couplings}
    for joint in joints:
        locked |= joint.constants
        locked |= {c.name: c.default for c in joint.coordinates if c.locked and c.name not in following}
    _check_root(values, joints, locked, following)
    return Skeleton(
        model.name,
        tuple(_skeleton_joint(joint, couplings) for joint in joints),
        tuple(markers),
        locked,
        float(-gravity[1]),
        start={
            c.name: c.default + _START * (sum(c.range) / 2 - c.default)
            for j in joints[1:]
            for c in j.coordinates
            if c.angle
        },
        ranges=_ranges(joints[1:], {*locked, *following}),
    )


def _ranges(joints: Sequence[JointElement], fixed: set[str]) -> dict[str, Range]:
    """Return the ranges of all independent coordinates of these joints.

    A range that ends before it begins, or of a full turn, is ignored.
    """
    free = [c for joint in joints for c in joint.coordinates if c.name not in fixed]
    return {
        c.name: Range(*c.range, c.clamped)
        for c in free
        if c.range[0] < c.range[1] and not (c.angle and c.range[1] - c.range[0] >= 2 * np.pi - _FULL_TURN_SLACK_RAD)
    }


def _kept(joint: JointElement) -> OsimJoint:
    return OsimJoint(joint.name, joint.coordinates, None if joint.offset is None else joint.offset.outer)


def _skeleton_joint(joint: JointElement, couplings: Sequence[Coupling]) -> Joint:
    axes = [_led(axis, couplings) for axis in joint.axes]
    return Joint(joint.parent, joint.child, *joint.parent_place, tuple(axes), *joint.child_place)


def _led(axis: Axis, couplings: Sequence[Coupling]) -> Axis:
    for coupling in reversed(couplings):
        if axis.coordinate == coupling.dependent:
            axis = coupled(axis, coupling.independent, coupling.function)
    return axis


def _check_root(
    values: Values, joints: Sequence[JointElement], locked: Mapping[str, float], following: set[str]
) -> None:
    root, *others = joints
    for joint in others:
        if joint.parent == "ground":
            beside = f"it puts '{joint.child}' on ground beside '{root.child}', expected one root body"
            values.fail(joint.element, beside, "O103")
    names = {axis.coordinate for axis in root.axes}
    free = len(names) == 6 and not names & {*locked, *following}
    free &= [axis.kind for axis in root.axes] == ["translation"] * 3 + ["rotation"] * 3
    free &= all(axis.function is None for axis in root.axes)
    if free:
        directions = np.array([axis.direction for axis in root.axes]).reshape(2, 3, 3)
        free = bool(np.allclose(directions @ directions.transpose(0, 2, 1), np.eye(3), atol=1e-6))
    if not free:
        axes = "three free translations, then three free rotations about axes at right angles, none of them locked"
        values.fail(root.element, f"between ground and '{root.child}' it must have {axes}", "O103")
