"""Reads joints of an OpenSim file, format 3 or 4, as axes in order: translations, then body-fixed rotations.

All OpenSim joints are such lists; a CustomJoint defines the function and the coordinate by which each axis moves, the
others have one coordinate per axis. Constant axes become locked coordinates of their own (`<joint>/<axis>`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NoReturn

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.errors import OsimError
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.opensim.xml import Element
from kinertia.model.coordinate_map import (
    AxisFunction,
    Composed,
    PiecewisePolynomial,
    constant,
    constant_value,
    linear,
    piecewise_linear,
    polynomial,
    simm_spline,
    unit_slope,
)
from kinertia.model.imported_model import OsimCoordinate
from kinertia.model.skeleton import Axis

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_AXES: dict[str, tuple[tuple[int, Literal["rotation", "translation"], tuple[float, float, float]], ...]] = {
    "WeldJoint": (),
    "PinJoint": ((0, "rotation", _Z),),
    "SliderJoint": ((0, "translation", _X),),
    "UniversalJoint": ((0, "rotation", _X), (1, "rotation", _Y)),
    "GimbalJoint": ((0, "rotation", _X), (1, "rotation", _Y), (2, "rotation", _Z)),
    "BallJoint": ((0, "rotation", _X), (1, "rotation", _Y), (2, "rotation", _Z)),
    "PlanarJoint": ((1, "translation", _X), (2, "translation", _Y), (0, "rotation", _Z)),
    "FreeJoint": (
        *((3, "translation", _X), (4, "translation", _Y), (5, "translation", _Z)),
        *((0, "rotation", _X), (1, "rotation", _Y), (2, "rotation", _Z)),
    ),
}
"""Per joint type and axis: which of the joint's coordinates moves it, and how."""
Place = tuple[np.ndarray, np.ndarray]
"""Rotation (3, 3) and translation (3,) m of a frame in another."""
FUNCTIONS = (
    "Constant",
    "LinearFunction",
    "PolynomialFunction",
    "SimmSpline",
    "PiecewiseLinearFunction",
    "MultiplierFunction",
)


@dataclass(frozen=True)
class Values:
    """Reader of properties of elements of one file.

    Attributes:
        path: the file.
        defaults: by tag, the element of the file's <defaults> that supplies properties left out.
    """

    path: Path
    defaults: Mapping[str, Element]

    def fail(self, element: Element, problem: str, code: str = "O102", owner: str | None = None) -> NoReturn:
        """Raise OsimError about this element.

        Args:
            element: the element in the file.
            problem: what is wrong, and what is expected.
            code: code of the rule; by default that of an unsupported element.
            owner: name of the owner of the element, if it has none itself.
        """
        name = element.name if owner is None else owner
        stated = {"element": Quantity(name), "kind": Quantity(element.tag), "problem": Quantity(problem)}
        raise OsimError.about(self.path, with_evidence(code, Where(part=name or None), stated), element.line)

    def property(self, element: Element, tag: str) -> Element | None:
        """Return the element's own property, or the one in the file's defaults."""
        stated = element.child(tag)
        if stated is None and element.tag in self.defaults:
            return self.defaults[element.tag].child(tag)
        return stated

    def text(self, element: Element, tag: str) -> str:
        """Read the text of a property, without surrounding blanks; empty where it is left out."""
        entry = self.property(element, tag)
        return "" if entry is None else entry.text.strip()

    def flag(self, element: Element, tag: str, otherwise: bool) -> bool:
        """Read a boolean; `otherwise` where the property is left out."""
        text = self.text(element, tag).lower()
        if text not in ("true", "false", ""):
            self.fail(element, f"{tag} is '{text}', expected true or false")
        return otherwise if text == "" else text == "true"

    def numbers(self, element: Element, tag: str, count: int, otherwise: list[float] | None = None) -> np.ndarray:
        """Read `count` finite numbers; `otherwise` where the property is left out."""
        entry = self.property(element, tag)
        if entry is None:
            if otherwise is None:
                self.fail(element, f"it has no {tag}, expected {count} number(s)")
            return np.array(otherwise)
        values = self._list(entry, element.name)
        if len(values) != count:
            self.fail(entry, f"it has {len(values)} numbers, expected {count}", owner=element.name)
        return values

    def _list(self, element: Element, owner: str) -> np.ndarray:
        try:
            values = np.array([float(word) for word in element.text.split()])
        except ValueError:
            self.fail(element, f"it is '{element.text.strip()[:60]}', expected numbers", owner=owner)
        if not np.isfinite(values).all():
            self.fail(element, "expected finite numbers", owner=owner)
        return values

    def function(self, element: Element, owner: str) -> PiecewisePolynomial:
        """Read a function of one coordinate.

        Args:
            element: element of the function itself.
            owner: the joint or constraint, for messages.
        """
        if element.tag == "MultiplierFunction":
            holder = element.child("function")
            inner = holder.children[0] if holder is not None and holder.children else None
            if inner is None:
                self.fail(element, "it multiplies nothing, expected a function in it", owner=owner)
            return self.function(inner, owner).scaled(self.numbers(element, "scale", 1, [1.0])[0])
        if element.tag == "Constant":
            return constant(self.numbers(element, "value", 1, [0.0])[0])
        if element.tag in ("LinearFunction", "PolynomialFunction"):
            return self._of_coefficients(element, owner)
        if element.tag in ("SimmSpline", "PiecewiseLinearFunction"):
            return self._of_points(element, owner)
        self.fail(element, f"this function is unknown, fit one of {', '.join(FUNCTIONS)} to it", owner=owner)

    def _of_coefficients(self, element: Element, owner: str) -> PiecewisePolynomial:
        entry = self.property(element, "coefficients")
        values = self._list(entry, owner) if entry is not None else np.array([1.0, 0.0])
        if element.tag == "LinearFunction":
            if len(values) != 2:
                self.fail(element, f"it has {len(values)} coefficients, expected two (one variable)", owner=owner)
            return linear(*values)
        if not len(values):
            self.fail(element, "it has no coefficients", owner=owner)
        return polynomial(values)

    def _of_points(self, element: Element, owner: str) -> PiecewisePolynomial:
        x, y = element.child("x"), element.child("y")
        if x is None or y is None:
            self.fail(element, "it has no x or no y", owner=owner)
        build = simm_spline if element.tag == "SimmSpline" else piecewise_linear
        try:
            return build(self._list(x, owner), self._list(y, owner))
        except ValueError as error:
            self.fail(element, str(error), owner=owner)


@dataclass(frozen=True)
class JointElement:
    """A joint as in the file.

    Attributes:
        element: its element in the file.
        parent, child: its bodies.
        parent_place, child_place: frames of the joint in the bodies.
        offset: element whose translation moves the joint in its parent's own axes; None where there is none.
        coordinates: coordinates in the file's order.
        axes: axes in the order of motion.
        constants: axes that do not move, by the name of the coordinate they are locked as.
    """

    element: Element
    parent: str
    child: str
    parent_place: Place
    child_place: Place
    offset: Element | None
    coordinates: tuple[OsimCoordinate, ...]
    axes: tuple[Axis, ...]
    constants: Mapping[str, float]

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.element.name


class Frames:
    """Bodies and positions of the frames of format 4."""

    def __init__(self, values: Values, model: Element, bodies: Sequence[str]) -> None:
        self._values, self._bodies = values, {"ground", *bodies}
        self._offsets: dict[tuple[str, str], Element] = {}
        self._collect(model)

    def _collect(self, owner: Element) -> None:
        for child in owner.children:
            if child.tag == "PhysicalOffsetFrame":
                self._offsets[owner.name, child.name] = child
            # the list that holds the frame has no name of its own
            self._collect(child if child.name else replace(child, attributes=owner.attributes))

    def offset(self, owner: str, path: str) -> Element | None:
        """Find the offset frame with this path: of this owner, of the one in the path, or the only one."""
        *above, name = path.strip().split("/")
        for holder in (owner, above[-1] if above else owner):
            if (holder, name) in self._offsets:
                return self._offsets[holder, name]
        known = [frame for (_, frame_name), frame in self._offsets.items() if frame_name == name]
        return known[0] if len(known) == 1 and name not in self._bodies else None

    def place(self, user: Element, owner: str, path: str) -> tuple[str, Place]:
        """Return body and position of the frame with this path."""
        rotation, translation = np.eye(3), np.zeros(3)
        for _ in range(20):
            frame = self.offset(owner, path)
            if frame is None:
                break
            turn, shift = frame_place(self._values, frame, "orientation", "translation")
            rotation, translation = turn @ rotation, shift + turn @ translation
            owner, path = frame.name, self._values.text(frame, "socket_parent")
        body = path.strip().split("/")[-1]
        if body not in self._bodies:
            problem = f"it is attached to '{path.strip()}', which is not in the file, expected a body or a frame"
            self._values.fail(user, problem, "O103")
        return body, (rotation, translation)


def frame_place(values: Values, element: Element, orientation: str, location: str) -> Place:
    """Return a frame's placement from its body-fixed x-y-z angles and its location."""
    angles = values.numbers(element, orientation, 3, [0.0] * 3)
    return Rotation.from_euler("XYZ", angles).as_matrix(), values.numbers(element, location, 3, [0.0] * 3)


def read_joint(values: Values, element: Element, frames: Frames) -> JointElement:
    """Read a joint of format 4."""
    sockets = [values.text(element, f"socket_{side}_frame") for side in ("parent", "child")]
    (parent, parent_place), (child, child_place) = (frames.place(element, element.name, path) for path in sockets)
    offset = frames.offset(element.name, sockets[0])
    if offset is not None and frames.offset(offset.name, values.text(offset, "socket_parent")) is not None:
        offset = None
    holder = element.child("coordinates")
    coordinates = [] if holder is None else [c for c in holder.children if c.tag == "Coordinate"]
    return _joint(values, element, (parent, child), (parent_place, child_place), offset, coordinates)


def read_joint_in_body(values: Values, element: Element, child: str) -> JointElement:
    """Read a joint of format 3, which is in its child's element."""
    if values.flag(element, "reverse", False):
        values.fail(element, "it is reversed, expected parent before child, as OpenSim 4 saves it")
    places = (
        frame_place(values, element, "orientation_in_parent", "location_in_parent"),
        frame_place(values, element, "orientation", "location"),
    )
    coordinates = list(element.all("Coordinate"))
    return _joint(values, element, (values.text(element, "parent_body"), child), places, element, coordinates)


def _joint(
    values: Values,
    element: Element,
    bodies: tuple[str, str],
    places: tuple[Place, Place],
    offset: Element | None,
    elements: list[Element],
) -> JointElement:
    names = [c.name for c in elements]
    if element.tag == "CustomJoint":
        axes, constants = _custom_axes(values, element, names)
    elif element.tag in _AXES:
        wanted = _AXES[element.tag]
        if len(names) != len(wanted):
            values.fail(element, f"it has {len(names)} coordinates, expected {len(wanted)}")
        axes, constants = [Axis(names[i], kind, direction) for i, kind, direction in wanted], {}
    else:
        values.fail(element, f"this kind of joint is unknown, expected one of {', '.join([*_AXES, 'CustomJoint'])}")
    turning = {axis.coordinate for axis in axes if axis.kind == "rotation" and axis.function is None}
    coordinates = [_coordinate(values, c, element.name, c.name in turning) for c in elements]
    return JointElement(element, *bodies, *places, offset, tuple(coordinates), tuple(axes), constants)


def _coordinate(values: Values, element: Element, joint: str, angle: bool) -> OsimCoordinate:
    function = values.property(element, "prescribed_function")
    if values.flag(element, "prescribed", False) and function is not None and function.children:
        values.fail(element, "it is prescribed over time, expected a free or locked one")
    low, high = values.numbers(element, "range", 2, [-10.0, 10.0])
    return OsimCoordinate(
        element.name,
        joint,
        float(values.numbers(element, "default_value", 1, [0.0])[0]),
        (float(low), float(high)),
        values.flag(element, "clamped", False),
        values.flag(element, "locked", False),
        angle,
    )


def _custom_axes(values: Values, joint: Element, names: list[str]) -> tuple[list[Axis], dict[str, float]]:
    transform = joint.child("SpatialTransform")
    elements = [] if transform is None else [e for e in transform.children if e.tag == "TransformAxis"]
    if len(elements) != 6:
        values.fail(joint, f"it has {len(elements)} TransformAxis, expected 3 rotations, then 3 translations")
    axes, constants = [], {}
    for i in (3, 4, 5, 0, 1, 2):
        element, kind = elements[i], "rotation" if i < 3 else "translation"
        direction = values.numbers(element, "axis", 3)
        length = np.linalg.norm(direction)
        if not length > 0:
            values.fail(element, f"its axis in the joint {joint.name} is zero, expected a direction")
        follows = values.text(element, "coordinates").replace('"', " ").split()
        function = _axis_function(values, element, joint.name)
        axis = Axis("", kind, tuple(map(float, direction / length)), function)  # type: ignore[arg-type]
        fixed = constant_value(function)
        if fixed is not None:
            if fixed != 0.0:
                name = f"{joint.name}/{element.name}"
                constants[name] = fixed
                axes.append(replace(axis, coordinate=name, function=None))
            continue
        if len(follows) != 1 or follows[0] not in names:
            coordinates = f"one coordinate of the joint {joint.name} ({', '.join(names) or 'it has none'})"
            values.fail(element, f"it follows {' and '.join(follows) or 'no coordinate'}, expected {coordinates}")
        axes.append(simplified(replace(axis, coordinate=follows[0])))
    return axes, constants


def _axis_function(values: Values, element: Element, joint: str) -> AxisFunction:
    """Read the function of a TransformAxis; without one OpenSim keeps the axis at zero."""
    inside = [c for c in element.children if c.tag not in ("coordinates", "axis", "coordinate")]
    if inside and inside[0].tag == "function":
        inside = inside[0].children
    return values.function(inside[0], joint) if inside else constant(0.0)


def simplified(axis: Axis) -> Axis:
    """Return the axis without a function that only copies the coordinate or reverses its sign."""
    slope = None if axis.function is None else unit_slope(axis.function)
    if slope is None:
        return axis
    x, y, z = axis.direction
    return replace(axis, direction=(slope * x, slope * y, slope * z), function=None)


def coupled(axis: Axis, independent: str, function: AxisFunction) -> Axis:
    """Return the axis of a coupled coordinate as an axis of the independent coordinate."""
    if axis.function is None:
        return simplified(replace(axis, coordinate=independent, function=function))
    whole = axis.function if unit_slope(function) == 1.0 else Composed(axis.function, function)
    return replace(axis, coordinate=independent, function=whole)
