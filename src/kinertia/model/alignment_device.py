"""Reads a knee alignment device in a static trial: where the knee marker would be, and the axis of flexion.

The device is clamped to the knee in place of the lateral knee marker. Its three markers, `LKAX` on the axis of flexion,
`LKD1` and `LKD2`, are at the ends of stalks of equal length, perpendicular to each other, whose corner is the place of
the marker (Vicon, Plug-in Gait Reference Guide). Within 2 mm that holds in the static trials of three laboratories.
"""

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers, Recording

_DEVICE = re.compile(r"(?P<before>.*?)(?P<side>[lr])k(?P<part>ax|d1|d2)", re.IGNORECASE)
_UNEQUAL = 0.1
"""Difference of the distances between its markers, over their mean, up to which three markers are a device's."""
_AXIS, _KNEE, _MALLEOLUS = "AX", "NE", "MED"


def device_labels(labels: Iterable[str]) -> tuple[str, ...]:
    """Return the labels of a device's markers, which are on no segment.

    >>> device_labels(["LKAX", "LKD1", "LKD2", "RKAX", "LKNE"])
    ('LKAX', 'LKD1', 'LKD2', 'RKAX')
    """
    return tuple(label for label in labels if _DEVICE.fullmatch(label))


def _devices(labels: Iterable[str]) -> dict[str, tuple[str, str, str]]:
    """Return the device's labels (axis first) by what comes before KAX: "L", or "subject_L"."""
    found: dict[str, dict[str, str]] = {}
    for label in labels:
        if match := _DEVICE.fullmatch(label):
            found.setdefault(match["before"] + match["side"], {})[match["part"].upper()] = label
    return {side: (own[_AXIS], own["D1"], own["D2"]) for side, own in found.items() if len(own) == 3}


def with_knees_of_device(recording: Recording, file: str) -> Recording:
    """Return the recording with the knee markers that a device stands for and the file lacks, and F166 for them."""
    markers = recording.markers
    devices = _devices(markers.labels)
    used = {label for own in devices.values() for label in own}
    others = [label for label in markers.labels if label not in used]
    added: dict[str, FloatArray] = {}
    for side, own in devices.items():
        label = _like(f"{side}k{_KNEE}", own[0])
        if label not in markers.labels and others:
            corner = _corner(markers.select(own).positions, markers.select(others).positions)
            added |= {} if corner is None else {label: corner}
    if not added:
        return recording
    source = Quantity("the corner of the three stalks of the knee alignment device")
    note = finding("F166", Where(file), points=Quantity(", ".join(added)), source=source)
    positions = np.concatenate([markers.positions, np.stack(list(added.values()), axis=1)], axis=1)
    completed = Markers(markers.time, (*markers.labels, *added), positions)
    return replace(recording, markers=completed, findings=(*recording.findings, note))


def _like(label: str, model: str) -> str:
    """Return the label in the capitals of another one."""
    return label.lower() if model.islower() else label[:-4] + label[-4:].upper()


def _corner(device: FloatArray, others: FloatArray) -> FloatArray | None:
    """Return the corner (n, 3) m of three stalks; None where the markers are not at equal distances.

    Args:
        device: its markers (n, 3, 3) m.
        others: all other markers (n, m, 3) m: of the two corners possible, the one nearer to them is on the knee.
    """
    sides_m = np.linalg.norm(device - np.roll(device, 1, axis=1), axis=2)
    seen = np.isfinite(sides_m).all(axis=1) & np.asarray(np.isfinite(others).all(axis=2)).any(axis=1)
    usual_m = np.median(sides_m[seen], axis=0) if seen.any() else np.zeros(3)
    if not seen.any() or np.ptp(usual_m) > _UNEQUAL * usual_m.mean():
        return None
    normal = np.cross(device[:, 1] - device[:, 0], device[:, 2] - device[:, 0])
    normal *= (usual_m.mean() / np.sqrt(6.0) / np.linalg.norm(normal, axis=1))[:, None]
    body = np.nanmedian(others[seen], axis=1)
    middle = device.mean(axis=1)
    away = [float(np.median(np.linalg.norm((middle + sign * normal)[seen] - body, axis=1))) for sign in (1, -1)]
    corner: FloatArray = middle + (normal if away[0] < away[1] else -normal)
    return corner


def with_alignment_device(marker_set: MarkerSet, labels: Iterable[str]) -> MarkerSet:
    """Return the set for a static trial with devices: the axis marker in place of the thigh wand, by which Plug-in Gait
    finds the knee, and the medial malleoli (`LMED`) that are marked with it.
    """
    landmarks = dict(marker_set.landmarks)
    for side, own in _devices(labels).items():
        end = side[-1].lower()
        landmarks[f"thigh_wand_{end}"] = (own[0],)
        malleolus = _like(f"{side}{_MALLEOLUS}", own[0])
        if f"ankle_medial_{end}" not in landmarks and malleolus in labels:
            landmarks[f"ankle_medial_{end}"] = (malleolus,)
    return replace(marker_set, landmarks=landmarks)
