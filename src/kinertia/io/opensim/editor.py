"""Writes other mass properties, markers and joint places into an OpenSim model file.

Only the numbers that change are replaced in the text of the file; everything else is unchanged, byte for byte.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinertia.io.opensim.exporter import body_text, weld_text
from kinertia.io.opensim.reader import INERTIA_TAGS, body_elements, marker_elements
from kinertia.io.opensim.xml import Element, parse, replaced
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Marker

if TYPE_CHECKING:
    import pandas as pd

_FORMAT_4 = 40000
CHANGE_COLUMNS = ("component", "property", "old", "new")


@dataclass(frozen=True)
class _Edit:
    """New content of a property of one element."""

    element: Element
    tag: str
    values: np.ndarray


def write_osim(
    path: str | Path,
    model: OsimModel,
    bsp: BodySegmentParameters,
    markers: Mapping[str, np.ndarray] | None = None,
    joint_shifts: Mapping[str, np.ndarray] | None = None,
    welds: Mapping[str, str] | None = None,
) -> pd.DataFrame:
    """Write the model's file with these parameters, and return what changed.

    Args:
        path: path of the new file.
        model: the model as read.
        bsp: parameters of some or all of its bodies.
        markers: positions by label, (3,) m in the marker's body.
        joint_shifts: by joint with an `offset`, its displacement (3,) m in its parent, in the parent's axes.
        welds: by segment of `bsp` that the model lacks, the body that it is welded to.

    Returns:
        one row per changed property: component, property, old and new text; no rows if nothing changed.
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
    Path(path).write_bytes(replaced(model.content, spans))
    import pandas as pd

    return pd.DataFrame(rows, columns=list(CHANGE_COLUMNS))


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
