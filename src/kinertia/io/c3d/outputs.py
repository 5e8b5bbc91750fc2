"""Writes model outputs and measures of strides into a copy of a C3D file.

ezc3d would rewrite the whole file: header, order and width of parameters, analog samples by their scales. Here the
bytes of markers, analog samples, events and all parameters but the lists of points are unchanged. Files of integers
become files of floats, as Vicon's own do when it adds model outputs: in the markers' steps of a tenth of a unit moments
would end at 3276 and powers be rounded to 0.1. Their numbers stay.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.c3d.file_contents import EventToWrite, add_events, subject_of
from kinertia.io.c3d.parameters import ParameterSection, Value, continued
from kinertia.io.c3d.structure import doubts_about, with_plain_samples
from kinertia.io.versions import VERSION

OWN_GROUP = "KINERTIA"
"""Group whose LABELS are the points that Kinertia wrote."""
_EDITOR = "Kinertia "
"""Begins our entry of the list of programs that changed a file (MANUFACTURER:EDITED, c3d.org)."""
_BLOCK = 512
_ORDERS = {84: "<", 86: ">"}
_MOST_IN_LIST = 255
OUTPUT_TYPES = {"ANGLES": "ANGLE", "FORCES": "FORCE", "MOMENTS": "MOMENT", "POWERS": "POWER"}
"""Types of outputs; each has its unit in a parameter of this name and _UNITS."""
_UNITS = {
    "ANGLES": {"deg": 1.0, "degree": 1.0, "degrees": 1.0, "rad": 180.0 / np.pi, "radians": 180.0 / np.pi},
    "FORCES": {"n": 1.0, "kn": 1e3},
    "MOMENTS": {"nmm": 1e-3, "ncm": 1e-2, "nm": 1.0},
    "POWERS": {"w": 1.0, "mw": 1e-3, "kw": 1e3},
}
"""By type: letters of units, per kg or not, and their factors to SI and degrees."""
USUAL_UNITS = {"ANGLES": "deg", "FORCES": "N", "MOMENTS": "Nmm", "POWERS": "W"}
"""Units of outputs in a file that states none: Vicon's."""
_GROUP = "ANALYSIS"
_OURS = "Kinertia"
_MOST = 255


class Measure(NamedTuple):
    """One value: side ("Left", "Right"), and name and unit as Vicon has them: "Walking Speed", "m/s"."""

    context: str
    name: str
    unit: str
    value: float


def add_analysis(section: ParameterSection, measures: Sequence[Measure], subject: str) -> None:
    """Write the measures into a file that states none of its own; those of an earlier export are replaced.

    Args:
        section: parameters of the file.
        measures: at most 255.
        subject: name of the person; empty where the file has no names.
    """
    names, described = (section.get(_GROUP, name) for name in ("NAMES", "DESCRIPTIONS"))
    stated = 0 if names is None else len(names)
    if not measures or len(measures) > _MOST or (stated and list(described or ()) != [_OURS] * stated):
        return
    lists: dict[str, Value] = {
        "USED": np.array([len(measures)], dtype=np.int16),
        "NAMES": [measure.name for measure in measures],
        "DESCRIPTIONS": [_OURS] * len(measures),
        "SUBJECTS": [subject] * len(measures),
        "CONTEXTS": [measure.context for measure in measures],
        "UNITS": [measure.unit for measure in measures],
        "VALUES": np.array([measure.value for measure in measures], dtype=np.float32),
    }
    for name, value in lists.items():
        section.put(_GROUP, name, value)


def unit_factor(kind: str, unit: str) -> float | None:
    """Return the factor of a unit of "ANGLES", "FORCES", "MOMENTS" or "POWERS" to SI and degrees; None if unknown."""
    return _UNITS[kind].get("".join(filter(str.isalpha, unit.lower().removesuffix("/kg"))))


@dataclass(frozen=True, eq=False)
class OutputPoint:
    """One output point to be written into a C3D file.

    Attributes:
        label: label without the subject's prefix.
        kind: "ANGLES", "FORCES", "MOMENTS" or "POWERS"; "" for a position.
        values: (f, 3) at all frames of the file, in its units; NaN where it is missing.
        description: what it is.
    """

    label: str
    kind: str
    values: np.ndarray
    description: str = ""


@dataclass(frozen=True, eq=False)
class C3dFrames:
    """Properties of a C3D file that a writer of outputs needs.

    Attributes:
        content: bytes of the file; those of markers and analog samples are `words`.
        labels: labels of its points, without Kinertia's own.
        first: number of the first frame.
        rate_hz: rate of the frames.
        points: (f, p, 3) in the file's units, NaN where missing; ordered as `labels`.
        units: units of "ANGLES", "FORCES", "MOMENTS", "POWERS", as the file states them; only those that it states.
    """

    content: bytes = field(repr=False)
    labels: tuple[str, ...]
    first: int
    rate_hz: float
    points: np.ndarray
    units: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class _Parts:
    """Parts of a C3D file: first blocks, parameters, words (f, 4 p + a) as floats, and the remainder."""

    before: bytes
    section: ParameterSection
    words: np.ndarray
    points: int
    after: bytes
    order: str


def frames_of(path: Path) -> C3dFrames:
    """Read labels and positions of the points of a C3D file that outputs are to be written into.

    Raises:
        FileError: it is damaged, has outputs in unknown units, or is stored in a form not written here (DEC numbers,
            poses of segments).
    """
    doubt = doubts_about(path, numbers_of_frames=False)
    if doubt:
        raise FileError(path, f"cannot take model outputs: {doubt}")
    content = with_plain_samples(path) or path.read_bytes()
    parts = _without_ours(_apart(content))
    labels = _labels(parts)
    first = struct.unpack_from(f"{parts.order}H", parts.before, 6)[0]
    rate_hz = struct.unpack_from(f"{parts.order}f", parts.before, 20)[0]
    samples = parts.words[:, : 4 * parts.points].reshape(len(parts.words), parts.points, 4).astype(float)
    seen = (samples[..., 3] >= 0) & np.isfinite(samples[..., :3]).all(axis=-1)
    stated = {kind: parts.section.get("POINT", f"{name}_UNITS") for kind, name in OUTPUT_TYPES.items()}
    units = {kind: str(texts[0]) for kind, texts in stated.items() if texts is not None and len(texts) and texts[0]}
    for kind, unit in units.items():
        if unit_factor(kind, unit) is None:
            raise FileError(path, f"cannot take model outputs: its {kind} are in '{unit}'")
    return C3dFrames(content, tuple(labels), first, rate_hz, np.where(seen[..., None], samples[..., :3], np.nan), units)


def with_outputs(
    frames: C3dFrames,
    outputs: Sequence[OutputPoint],
    prefix: str,
    units: Mapping[str, str],
    parameters: Mapping[str, tuple[Value, tuple[int, ...] | None]],
    events: Sequence[EventToWrite] = (),
    measures: Sequence[Measure] = (),
) -> bytes:
    """Return the file with these points appended and listed by type, and with the group KINERTIA.

    Args:
        frames: of the file; what Kinertia wrote into it before is replaced.
        outputs: with labels that no other point has.
        prefix: of labels, "Anna:"; empty for none.
        units: of the types, for a file that states none; omitted if other outputs have different units (`USUAL_UNITS`).
        parameters: entries of the group KINERTIA by name: value, and shape as `ParameterSection.put` has it.
        events: events; those that the file lacks are added.
        measures: measures of strides, for a file that states none.

    Raises:
        TooManyParameters: they do not fit.
    """
    parts = _without_ours(_apart(frames.content))
    section, labels = parts.section, [prefix + output.label for output in outputs]
    _put_list(section, "LABELS", [*_labels(parts), *labels])
    described = _listed(section, "DESCRIPTIONS")[: parts.points]
    described += [""] * (parts.points - len(described)) + [output.description for output in outputs]
    _put_list(section, "DESCRIPTIONS", described)
    groups = list(_texts(section, "TYPE_GROUPS"))
    for kind, name in OUTPUT_TYPES.items():
        ours = [label for label, output in zip(labels, outputs, strict=True) if output.kind == kind]
        if not ours:
            continue
        already = _listed(section, kind)
        _put_list(section, kind, [*already, *ours])
        if kind not in groups[::2]:
            groups += [kind, name]
        if (not already or units[kind] == USUAL_UNITS[kind]) and not any(_texts(section, f"{name}_UNITS")):
            section.put("POINT", f"{name}_UNITS", [units[kind]])
    if groups:
        section.put("POINT", "TYPE_GROUPS", groups, (2, len(groups) // 2))
    _put_list(section, "LABELS", labels, OWN_GROUP)
    for key, (value, shape) in parameters.items():
        section.put(OWN_GROUP, key, value, shape)
    subject = subject_of(section, prefix.removesuffix(":"))
    others = {label.split(":", 1)[0] for label in frames.labels if ":" in label} - {subject}
    add_events(section, events, subject, others)
    add_analysis(section, measures, subject)
    edited = [text for text in _texts(section, "EDITED", "MANUFACTURER") if not text.startswith(_EDITOR)]
    section.put("MANUFACTURER", "EDITED", [*edited, f"{_EDITOR}{VERSION}"])
    return _together(parts, np.concatenate([_four(output.values) for output in outputs], axis=1))


def _four(values: np.ndarray) -> np.ndarray:
    """Return the words (f, 4) of a point: 0 0 0 -1 where it is missing."""
    seen = np.isfinite(values).all(axis=1)
    return np.column_stack([np.where(seen[:, None], values, 0.0), np.where(seen, 0.0, -1.0)])


def _apart(content: bytes) -> _Parts:
    start = _BLOCK * (content[0] - 1)
    order = _ORDERS[content[start + 3]]
    section = ParameterSection(content[start : start + _BLOCK * content[start + 2]], order)
    points, analogs, first, last = struct.unpack_from(f"{order}4H", content, 2)
    (scale,) = struct.unpack_from(f"{order}f", content, 12)
    at, per_frame, count = (
        _BLOCK * (struct.unpack_from(f"{order}H", content, 16)[0] - 1),
        4 * points + analogs,
        last - first + 1,
    )
    stored = "f4" if scale < 0 else "i2"
    words = np.frombuffer(content, f"{order}{stored}", per_frame * count, at).reshape(count, per_frame)
    before = bytearray(content[:start])
    after = content[at + words.nbytes :]
    if scale > 0:
        words = _as_floats(words, points, scale, order)
        struct.pack_into(f"{order}f", before, 12, -scale)
        section.put("POINT", "SCALE", np.array([-scale], dtype=np.float32))
    return _Parts(bytes(before), section, words, points, after, order)


def _as_floats(words: np.ndarray, points: int, scale: float, order: str) -> np.ndarray:
    """Convert words of an integer file to floats: positions by their scale, samples and residuals unchanged."""
    result = words.astype(f"{order}f4")
    places = result[:, : 4 * points].reshape(len(words), points, 4)
    places[..., :3] *= np.float32(scale)
    return result


def _without_ours(parts: _Parts) -> _Parts:
    """Remove what an earlier export wrote."""
    section = parts.section
    ours = set(_listed(section, "LABELS", OWN_GROUP))
    section.drop(OWN_GROUP)
    labels = _labels(parts)
    kept = [k for k, label in enumerate(labels) if label not in ours]
    if len(kept) == len(labels):
        return parts
    described = _listed(section, "DESCRIPTIONS")
    _put_list(section, "LABELS", [labels[k] for k in kept])
    if described:
        _put_list(section, "DESCRIPTIONS", [described[k] for k in kept if k < len(described)])
    for kind in OUTPUT_TYPES:
        listed = _listed(section, kind)
        if ours & set(listed):
            _put_list(section, kind, [label for label in listed if label not in ours])
    of_points = (4 * np.array(kept, dtype=int)[:, None] + np.arange(4)).ravel()
    columns = np.concatenate([of_points, np.arange(4 * parts.points, parts.words.shape[1])])
    return _Parts(parts.before, section, parts.words[:, columns], len(kept), parts.after, parts.order)


def _together(parts: _Parts, added: np.ndarray) -> bytes:
    """Assemble the file, with more points (f, 4 k)."""
    order, section = parts.order, parts.section
    split, points = 4 * parts.points, parts.points + added.shape[1] // 4
    words = np.hstack([parts.words[:, :split], added.astype(f"{order}f4"), parts.words[:, split:]])
    section.put("POINT", "USED", np.array([points], dtype=np.int16))
    section.put("POINT", "DATA_START", np.array([1], dtype=np.int16))
    at = len(parts.before) + len(section.content())
    section.put("POINT", "DATA_START", np.array([at // _BLOCK + 1], dtype=np.int16))
    before = bytearray(parts.before)
    struct.pack_into(f"{order}H", before, 2, points)
    struct.pack_into(f"{order}H", before, 16, at // _BLOCK + 1)
    data = bytes(before) + section.content() + words.astype(f"{order}f4", copy=False).tobytes()
    data += parts.after if parts.after.strip(b"\0") else b""
    return data.ljust(-(-len(data) // _BLOCK) * _BLOCK, b"\0")


def _texts(section: ParameterSection, name: str, group: str = "POINT") -> list[str]:
    value = section.get(group, name)
    return [] if value is None or isinstance(value, np.ndarray) else list(value)


def _listed(section: ParameterSection, name: str, group: str = "POINT") -> list[str]:
    """Read a list of texts that continues in NAME2, NAME3."""
    return continued(lambda key: _texts(section, key, group), name)


def _labels(parts: _Parts) -> list[str]:
    """Return one label per point."""
    labels = _listed(parts.section, "LABELS")[: parts.points]
    return labels + [""] * (parts.points - len(labels))


def _put_list(section: ParameterSection, name: str, texts: Sequence[str], group: str = "POINT") -> None:
    """Write a list, 255 entries in each of NAME, NAME2 ..., without touching parts that stay the same."""
    for k, start in enumerate(range(0, max(len(texts), 1), _MOST_IN_LIST)):
        some, called = list(texts[start : start + _MOST_IN_LIST]), name + ("" if k == 0 else str(k + 1))
        if section.get(group, called) != some:
            section.put(group, called, some)


def too_many(path: Path) -> FileError:
    """Return the error for a file without room for more parameters."""
    return FileError.found(
        path, "F106", what=Quantity("its parameters fill all the 255 blocks that a C3D file can have")
    )
