"""Writes OpenSim models: a skeleton built here, or a user's file with other masses, markers and joint positions.

Every joint becomes a CustomJoint (or a WeldJoint) with the skeleton's own coordinate names. Locked coordinates are
constants: those at the beginning and end of a joint place its frames in parent and child, those between moving axes
stay as axes that do not move. OpenSim 4.0 and later open it. There are no muscles and no geometry.

Only the numbers that change are replaced in the text of the file; everything else is unchanged, byte for byte.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.io.opensim.xml import Element, parse, replaced
from kinertia.io.output_folder import write_then_rename
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton, inverse, placed, placed_by

if TYPE_CHECKING:
    import pandas as pd

_FORMAT = 40000
"""The oldest of the current formats: every OpenSim 4 reads it."""
_ANGLE_RANGE, _LENGTH_RANGE = "-3.15 3.15", "-10 10"
_FORMAT_4 = 40000
CHANGE_COLUMNS = ("component", "property", "old", "new")


def export_osim(path: str | Path, skeleton: Skeleton, bsp: BodySegmentParameters) -> None:
    """Write the file of `osim_text`; it appears complete or not at all."""
    write_then_rename(Path(path), osim_text(skeleton, bsp))


def osim_text(skeleton: Skeleton, bsp: BodySegmentParameters) -> str:
    """Return the file of the skeleton with these body segment parameters; segments without any are massless.

    Raises:
        ValueError: an axis follows its coordinate by a function, or rotates before another translates.
    """
    rows = dict(zip(bsp.segments, bsp.table(), strict=True))
    bodies = [body_text(segment, rows.get(segment, np.zeros(10))) for segment in skeleton.segments]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8" ?>',
            f'<OpenSimDocument Version="{_FORMAT}">',
            f"<Model name={_quoted(skeleton.name)}>",
            f"<gravity>0 {-skeleton.gravity_m_s2!r} 0</gravity>",
            "<length_units>meters</length_units>",
            "<force_units>N</force_units>",
            *_set("BodySet", bodies),
            *_set("JointSet", [_joint(joint, skeleton) for joint in skeleton.joints]),
            *_set("MarkerSet", [_marker(marker) for marker in skeleton.markers]),
            "</Model>",
            "</OpenSimDocument>",
            "",
        ]
    )


def _set(tag: str, objects: Sequence[str]) -> list[str]:
    return [f"<{tag} name={_quoted(tag.lower())}>", "<objects>", *objects, "</objects>", "<groups />", f"</{tag}>"]


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def body_text(name: str, row: np.ndarray) -> str:
    """Write a body of the current formats; `row` is one of `BodySegmentParameters.table`."""
    return (
        f"<Body name={_quoted(name)}><mass>{_numbers(row[:1])}</mass><mass_center>{_numbers(row[1:4])}</mass_center>"
        f"<inertia>{_numbers(row[4:])}</inertia></Body>"
    )


def _marker(marker: Marker) -> str:
    return (
        f"<Marker name={_quoted(marker.label)}><socket_parent_frame>/bodyset/{escape(marker.segment)}"
        f"</socket_parent_frame><location>{_numbers(marker.position)}</location><fixed>false</fixed></Marker>"
    )


def weld_text(parent: str, child: str) -> str:
    """Write a joint of the current formats that fixes one body in the frame of another."""
    near, far = (_frame(f"{name}_offset", f"/bodyset/{name}", np.eye(3), np.zeros(3)) for name in (parent, child))
    return (
        f"<WeldJoint name={_quoted('to_' + child)}><socket_parent_frame>{parent}_offset</socket_parent_frame>"
        f"<socket_child_frame>{child}_offset</socket_child_frame><frames>{near}{far}</frames></WeldJoint>"
    )


def _joint(joint: Joint, skeleton: Skeleton) -> str:
    joint = _folded(joint, skeleton)
    slides = [axis for axis in joint.axes if axis.kind == "translation"]
    turns = [axis for axis in joint.axes if axis.kind == "rotation"]
    if [*slides, *turns] != list(joint.axes) or any(axis.function is not None for axis in joint.axes):
        raise ValueError(f"the joint of {joint.child} has axes that a file of plain coordinates cannot hold")
    parent = "/ground" if joint.parent == "ground" else f"/bodyset/{joint.parent}"
    name = "ground_" + joint.child if joint.parent == "ground" else "to_" + joint.child
    near = _frame(f"{joint.parent}_offset", parent, joint.rotation, joint.translation)
    far = _frame(f"{joint.child}_offset", f"/bodyset/{joint.child}", joint.child_rotation, joint.child_translation)
    free = [axis for axis in (*turns, *slides) if axis.coordinate not in skeleton.locked]
    kind = "CustomJoint" if joint.axes else "WeldJoint"
    inside = [
        f"<{kind} name={_quoted(name)}>",
        f"<socket_parent_frame>{joint.parent}_offset</socket_parent_frame>",
        f"<socket_child_frame>{joint.child}_offset</socket_child_frame>",
        f"<coordinates>{''.join(_coordinate(axis) for axis in free)}</coordinates>",
        f"<frames>{near}{far}</frames>",
    ]
    if joint.axes:
        axes = [*_filled("rotation", turns, skeleton), *_filled("translation", slides, skeleton)]
        inside += ["<SpatialTransform>", *axes, "</SpatialTransform>"]
    return "\n".join([*inside, f"</{kind}>"])


def _folded(joint: Joint, skeleton: Skeleton) -> Joint:
    """Return the joint without axes locked at zero, with its two frames where locked axes at its beginning and end put
    them.
    """
    axes = [axis for axis in joint.axes if skeleton.locked.get(axis.coordinate) != 0.0 or axis.function is not None]
    near = placed(joint.rotation, joint.translation)
    far = placed(joint.child_rotation, joint.child_translation)
    while axes and axes[0].coordinate in skeleton.locked:
        axis = axes.pop(0)
        near = near @ placed_by(axis, skeleton.locked[axis.coordinate])
    while axes and axes[-1].coordinate in skeleton.locked:
        axis = axes.pop()
        far = far @ inverse(placed_by(axis, skeleton.locked[axis.coordinate]))
    frames = (near[:3, :3], near[:3, 3], tuple(axes), far[:3, :3], far[:3, 3])
    return Joint(joint.parent, joint.child, *frames)


def _frame(name: str, parent: str, rotation: np.ndarray, translation: np.ndarray) -> str:
    with warnings.catch_warnings(action="ignore"):  # at gimbal lock one of the possible triples will do
        angles = Rotation.from_matrix(np.asarray(rotation)).as_euler("XYZ")
    return (
        f"<PhysicalOffsetFrame name={_quoted(name)}><socket_parent>{parent}</socket_parent>"
        f"<translation>{_numbers(translation)}</translation><orientation>{_numbers(angles)}</orientation>"
        f"</PhysicalOffsetFrame>"
    )


def _quoted(text: str) -> str:
    """Return an attribute's value in quotes."""
    return f'"{escape(text)}"'


def _coordinate(axis: Axis) -> str:
    limits = _ANGLE_RANGE if axis.kind == "rotation" else _LENGTH_RANGE
    return f"<Coordinate name={_quoted(axis.coordinate)}><range>{limits}</range></Coordinate>"


def _filled(kind: str, axes: Sequence[Axis], skeleton: Skeleton) -> list[str]:
    """Return three TransformAxis elements: these axes, then axes at zero that keep the three independent."""
    directions = [np.array(axis.direction) for axis in axes]
    spare: list[np.ndarray] = []
    while len(directions) + len(spare) < 3:
        taken = np.array([*directions, *spare]).reshape(-1, 3)
        spare.append(np.linalg.svd(taken)[2][-1] if len(taken) else np.eye(3)[0])
    elements = [
        _axis(f"{kind}{i + 1}", axis.direction, "" if axis.coordinate in skeleton.locked else axis.coordinate, value)
        for i, axis in enumerate(axes)
        for value in [skeleton.locked.get(axis.coordinate, 0.0)]
    ]
    return elements + [_axis(f"{kind}{len(axes) + i + 1}", direction, "", 0.0) for i, direction in enumerate(spare)]


def _axis(name: str, direction: Sequence[float] | np.ndarray, coordinate: str, value: float) -> str:
    function = f'<Constant name="function"><value>{value!r}</value></Constant>'
    if coordinate:
        function = '<LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction>'
    return (
        f'<TransformAxis name="{name}"><coordinates>{escape(coordinate)}</coordinates>'
        f"<axis>{_numbers(direction)}</axis>{function}</TransformAxis>"
    )


@dataclass(frozen=True)
class _Edit:
    """New content of a property of one element."""

    element: Element
    tag: str
    values: np.ndarray


def edited_osim(
    model: OsimModel,
    bsp: BodySegmentParameters,
    markers: Mapping[str, np.ndarray] | None = None,
    joint_shifts: Mapping[str, np.ndarray] | None = None,
    welds: Mapping[str, str] | None = None,
) -> tuple[bytes, pd.DataFrame]:
    """Return the model's file with these parameters, and what changed.

    Args:
        model: the model as read.
        bsp: parameters of some or all of its bodies.
        markers: positions by label, (3,) m in the marker's body.
        joint_shifts: by joint with an `offset`, its displacement (3,) m in its parent, in the parent's axes.
        welds: by segment of `bsp` that the model lacks, the body that it is welded to.

    Returns:
        the file's content, and one row per changed property: component, property, old and new text; no rows if nothing
        changed.
    """
    top = parse(model.content)
    document = top.child("Model")
    assert document is not None  # it was read before
    edits = [*_body_edits(document, bsp), *_marker_edits(model, document, markers or {})]
    edits += _joint_edits(model, document, joint_shifts or {})
    spans, rows = [], []
    for edit in edits:
        old = edit.element.child(edit.tag)
        before = "" if old is None else " ".join(old.text.split())
        if before and np.array_equal(np.array(before.split(), dtype=float), edit.values):
            continue
        new = " ".join(repr(float(value)) for value in edit.values)
        spans.append(_replacement(edit.element, edit.tag, old, new))
        rows.append((edit.element.name, edit.tag, before, new))
    for child, parent in (welds or {}).items():
        row = bsp.table()[bsp.segments.index(child)]
        spans += _welded(top, document, parent, child, row)
        rows.append((child, "body", "", f"welded to {parent}, {float(row[0])!r} kg"))
    import pandas as pd

    return replaced(model.content, spans), pd.DataFrame(rows, columns=list(CHANGE_COLUMNS))


def _replacement(element: Element, tag: str, old: Element | None, new: str) -> tuple[tuple[int, int], bytes]:
    """Return the byte span and its new content."""
    if old is not None and old.inner is not None:
        return old.inner, new.encode()
    whole = f"<{tag}>{new}</{tag}>".encode()
    if old is not None:
        return old.outer, whole
    assert element.inner is not None  # it has other properties
    return (element.inner[1], element.inner[1]), whole


def _welded(
    top: Element, document: Element, parent: str, child: str, row: np.ndarray
) -> list[tuple[tuple[int, int], bytes]]:
    """Return the insertions for one more body: in format 3 the joint is in its body, in format 4 in a set."""
    from kinertia.io.opensim.reader import INERTIA_TAGS  # loaded when it is needed

    ends = {}
    for tag in ("BodySet", "JointSet"):
        objects = members.child("objects") if (members := document.child(tag)) is not None else None
        ends[tag] = objects.inner[1] if objects is not None and objects.inner is not None else 0
    if int(top.attributes["Version"]) >= _FORMAT_4:
        texts = {"BodySet": body_text(child, row), "JointSet": weld_text(parent, child)}
    else:
        values = " ".join(repr(float(value)) for value in row[1:4])
        inertia = "".join(f"<{tag}>{float(value)!r}</{tag}>" for tag, value in zip(INERTIA_TAGS, row[4:], strict=True))
        joint = f'<WeldJoint name="to_{child}"><parent_body>{parent}</parent_body></WeldJoint>'
        text = f'<Body name="{child}"><mass>{float(row[0])!r}</mass><mass_center>{values}</mass_center>{inertia}'
        texts = {"BodySet": f"{text}<Joint>{joint}</Joint></Body>"}
    return [((ends[tag], ends[tag]), f"{text}\n".encode()) for tag, text in texts.items()]


def _body_edits(document: Element, bsp: BodySegmentParameters) -> Iterator[_Edit]:
    from kinertia.io.opensim.reader import INERTIA_TAGS, body_elements  # loaded when it is needed

    rows = dict(zip(bsp.segments, bsp.table(), strict=True))
    for body in body_elements(document):
        row = rows.get(body.name)
        if row is None or row[0] == 0.0:  # massless bodies stay as they are
            continue
        yield _Edit(body, "mass", row[:1])
        yield _Edit(body, "mass_center", row[1:4])
        if any(body.child(tag) is not None for tag in INERTIA_TAGS):
            for tag, value in zip(INERTIA_TAGS, row[4:], strict=True):
                yield _Edit(body, tag, np.array([value]))
        else:
            yield _Edit(body, "inertia", row[4:])


def _marker_edits(model: OsimModel, document: Element, positions: Mapping[str, np.ndarray]) -> Iterator[_Edit]:
    """Yield edits of markers, each in the axes of its own frame, which may differ from its body's."""
    from kinertia.io.opensim.reader import marker_elements  # loaded when it is needed

    known: dict[str, Marker] = {marker.label: marker for marker in model.skeleton.markers}
    for element in marker_elements(document):
        if element.name in positions:
            shift = positions[element.name] - known[element.name].position
            if shift.any():
                frame = model.marker_frames[element.name]
                location = element.child("location")
                old = np.array(location.text.split(), dtype=float) if location is not None else np.zeros(3)
                yield _Edit(element, "location", old + frame.T @ shift)


def _joint_edits(model: OsimModel, document: Element, shifts: Mapping[str, np.ndarray]) -> Iterator[_Edit]:
    """Yield edits of joints, by the frame each is attached to (format 4) or its location in its parent (format 3)."""
    elements = {element.outer: element for element in document.all()}
    for joint in model.joints:
        shift = shifts.get(joint.name)
        if shift is not None and joint.offset is not None and shift.any():
            offset = elements[joint.offset]
            tag = "translation" if offset.tag == "PhysicalOffsetFrame" else "location_in_parent"
            old = offset.child(tag)
            place = np.array(old.text.split(), dtype=float) if old is not None else np.zeros(3)
            yield _Edit(offset, tag, place + shift)
