"""Defines `MarkerSet`: the assignment of labels to landmarks, and of markers to segments.

Only marker sets contain a laboratory's labels. They come from files (`kinertia.io.marker_set_file`).
"""

import difflib
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Self

import numpy as np

from kinertia.errors import MarkerSetError, problem_of
from kinertia.findings.display import first_few
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import Markers

SEGMENTS = (
    "pelvis",
    "torso",
    *(f"{name}_{side}" for side in "rl" for name in ("thigh", "shank", "foot", "upper_arm", "forearm")),
)
_SIDED = [
    "asis",
    "psis",
    "knee_lateral",
    "knee_medial",
    "thigh_wand",
    "ankle_lateral",
    "ankle_medial",
    "shank_wand",
    "heel",
    "metatarsal",
    "toe",
    "acromion",
    "elbow_lateral",
    "elbow_medial",
    "wrist",
]
LANDMARKS = (
    *(f"{name}_{side}" for name in _SIDED for side in "rl"),
    "sacrum",
    "c7",
    "sternal_notch",
    "head_top",
)
ENOUGH_LABELS = 2.0 / 3.0
"""Least share of a set's labels, or of those of its pelvis, legs and feet, that a recording must have for the set,
whether the user named it or it is a preset. Measured recordings that lack part of their own set have 0.76 and more; two
of other laboratories' sets have up to 0.62 of the labels of Plug-in Gait, which mean something else there."""
_PREFIX_SHARE = 0.9
"""Share of the labels that begin with a person's name: unnamed trajectories and objects have others."""
_PREFIX_END = re.compile(r"[-_. ](?=.)")
_COMPUTED_M = 1e-4
SIDE_NAMES = {"r": "right", "l": "left"}
_FOOT = ("heel", "metatarsal")
_LEGS = ("pelvis", "thigh", "shank", "foot")
WIDTHS = tuple(f"{name}_{side}" for name in ("knee", "ankle", "elbow") for side in "rl")


@dataclass(frozen=True)
class MarkerSet:
    """Landmarks and segment markers, by a laboratory's labels.

    Attributes:
        name: for messages.
        landmarks: landmark -> labels whose mean position it is.
        segments: segment -> labels of the markers that move with it.
        widths: joint -> name of a measurement (m) that comes with the static file.
        in_model: one frame with the markers in an OpenSim model's default pose; None for a laboratory's.
        respelled: label of the preset -> its spelling in a recording, if different.
        spellings: label -> other labels that laboratories use for the same marker.

    Examples:
        >>> kinertia.read_marker_set("plug-in-gait").foot_labels()["r"]
        ['RHEE', 'RTOE']
    """

    name: str
    landmarks: Mapping[str, tuple[str, ...]]
    segments: Mapping[str, tuple[str, ...]]
    widths: Mapping[str, str]
    in_model: Markers | None = None
    respelled: Mapping[str, str] = field(default_factory=dict)
    spellings: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """All labels, each once."""
        named = [label for labels in (*self.segments.values(), *self.landmarks.values()) for label in labels]
        return tuple(dict.fromkeys(named))

    def foot_labels(self) -> dict[str, list[str]]:
        """Return the labels of the markers on the right ("r") and left ("l") foot."""
        return {side: list(self.segments[f"foot_{side}"]) for side in "rl"}

    def without(self, labels: Collection[str]) -> Self:
        """Return the set without these labels, and without the landmarks that need one of them."""
        return replace(
            self,
            landmarks={
                name: labels_of_landmark
                for name, labels_of_landmark in self.landmarks.items()
                if not set(labels_of_landmark) & set(labels)
            },
            segments={
                name: tuple(label for label in labels_of_segment if label not in labels)
                for name, labels_of_segment in self.segments.items()
            },
        )


def spelled_as(marker_set: MarkerSet, labels: Sequence[str]) -> MarkerSet:
    """Return the set with missing labels spelled as in the recording, if only one of its labels is possible.

    Spellings may differ in capitals and punctuation, be another known name of the marker, or begin with a person's name
    that all labels share, as in "Anna_LASI" or "Anna-LASI".

    Args:
        marker_set: its labels may have been retyped by hand or changed by a program.
        labels: of a recording.
    """
    spelled = spellings(marker_set.labels, labels)
    named = {
        label: set(map(folded, names))
        for label, names in marker_set.spellings.items()
        if label in marker_set.labels and label not in labels and label not in spelled
    }
    taken = {*marker_set.labels, *spelled.values()}
    spelled |= _matched(named, [label for label in labels if label not in taken], shared_prefix(labels))
    if not spelled:
        return marker_set

    def respelled(entries: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        return {name: tuple(spelled.get(label, label) for label in entry) for name, entry in entries.items()}

    return replace(
        marker_set,
        landmarks=respelled(marker_set.landmarks),
        segments=respelled(marker_set.segments),
        respelled=spelled,
    )


def spellings(wanted: Sequence[str], labels: Sequence[str]) -> dict[str, str]:
    """Map each wanted label that is not among these to the one that differs in capitals or punctuation only, or by a
    person's name before all labels of either.
    """
    prefix = shared_prefix(wanted)
    names = {label: {folded(label), folded(label.removeprefix(prefix))} for label in wanted if label not in labels}
    return _matched(names, [label for label in labels if label not in wanted], shared_prefix(labels))


def shared_prefix(labels: Sequence[str]) -> str:
    """Return the longest prefix up to an underscore, hyphen, point or blank of nearly all labels; empty without one.

    >>> shared_prefix(["S_01-LASI", "S_01-RASI", "S_01-LKNE_1"])
    'S_01-'
    """
    parts = Counter(label[: sep.end()] for label in labels for sep in _PREFIX_END.finditer(label))
    return max((prefix for prefix, count in parts.items() if count >= _PREFIX_SHARE * len(labels)), key=len, default="")


def _matched(names: Mapping[str, set[str]], labels: Sequence[str], prefix: str) -> dict[str, str]:
    """Map each label of a set to the one of these labels that is among its names (folded, with or without the prefix)
    and not claimed twice.
    """
    known: dict[str, list[str]] = {}
    for candidate in labels:
        for form in {folded(candidate), folded(candidate.removeprefix(prefix))}:
            known.setdefault(form, []).append(candidate)
    fitting = {
        label: {candidate for form in forms for candidate in known.get(form, ())} for label, forms in names.items()
    }
    claims = Counter(candidate for found in fitting.values() for candidate in found)
    return {
        label: candidate
        for label, found in fitting.items()
        if len(found) == 1
        for candidate in found
        if claims[candidate] == 1
    }


def with_posterior_pelvis(marker_set: MarkerSet, labels: Sequence[str]) -> MarkerSet:
    """Return the set without the sacral marker, or without the PSIS, if the labels contain only the other.

    Plug-in Gait has either (Vicon, Plug-in Gait Reference Guide): the pelvis needs one of them, and whichever a
    laboratory does not use is not missing.
    """
    psis, sacrum = (
        {label for name in names for label in marker_set.landmarks.get(name, ())}
        for names in (("psis_r", "psis_l"), ("sacrum",))
    )
    if not psis or not sacrum or sacrum & psis:
        return marker_set
    if not sacrum <= set(labels):
        return marker_set.without(sacrum)
    return marker_set if psis & set(labels) else marker_set.without(psis)


def without_computed_sacrum(marker_set: MarkerSet, markers: Markers) -> MarkerSet:
    """Return the set without a sacral marker that a program computed as the middle of the PSIS: it is redundant.

    Args:
        marker_set: of the recording.
        markers: (n frames); a real marker's distance to the middle is not constant to a tenth of a millimetre.
    """
    names = ("sacrum", "psis_r", "psis_l")
    labels = [label for name in names for label in marker_set.landmarks.get(name, ())]
    if len(labels) != len(names) or not set(labels) <= set(markers.labels):
        return marker_set
    sacrum, *psis = markers.select(labels).positions.transpose(1, 0, 2)
    off = np.linalg.norm(sacrum - (psis[0] + psis[1]) / 2, axis=1)
    off = off[np.isfinite(off)]
    return marker_set.without(labels[:1]) if off.size and off.max() < _COMPUTED_M else marker_set


def check_marker_set(marker_set: MarkerSet, labels: Sequence[str]) -> None:
    """Raise MarkerSetError if a marker set that the user named does not match these labels."""
    if not matches_labels(marker_set, labels):
        raise mismatch(marker_set, labels)


def label_share(marker_set: MarkerSet, labels: Sequence[str]) -> float:
    """Return the share of the set's labels that are among these."""
    wanted = set(marker_set.labels)
    return len(wanted & set(labels)) / len(wanted)


def matches_labels(marker_set: MarkerSet, labels: Sequence[str]) -> bool:
    """Decide whether these labels match the set: most of its own, or of those of its pelvis, legs and feet.

    Without trunk and arms a set still makes a model, without legs it does not.
    """
    return max(label_share(marker_set, labels), _leg_label_share(marker_set, labels)) >= ENOUGH_LABELS


def fits_person(marker_set: MarkerSet, labels: Sequence[str]) -> bool:
    """Decide whether a preset is used and has heels and metatarsals here, without which no foot can be built.

    The marker sets of two laboratories may share most labels but not these.
    """
    sides = [[label for side in "rl" for label in marker_set.landmarks.get(f"{name}_{side}", ())] for name in _FOOT]
    return matches_labels(marker_set, labels) and all(
        set(labels_of_side) & set(labels) for labels_of_side in sides if labels_of_side
    )


def _leg_label_share(marker_set: MarkerSet, labels: Sequence[str]) -> float:
    """Return the share of the labels of pelvis, legs and feet that are among these."""
    legs = {
        label
        for name, labels_of_segment in marker_set.segments.items()
        if name.startswith(_LEGS)
        for label in labels_of_segment
    }
    return len(legs & set(labels)) / max(len(legs), 1)


def mismatch(marker_set: MarkerSet, labels: Sequence[str]) -> MarkerSetError:
    """Make the error that these labels do not match the set (L101), with the missing ones."""
    missing = [label for label in marker_set.labels if label not in labels]
    nearest = nearest_labels(missing, labels)
    found = no_marker_set(marker_set.name, len(marker_set.labels), nearest)
    return MarkerSetError(problem_of(found), missing, nearest).with_finding(found)


def no_marker_set(name: str, count: int, missing: Mapping[str, Sequence[str]]) -> Finding:
    """Make L101: too many of a set's labels are missing; each is listed with similar labels."""
    return finding(
        "L101",
        labels_found=Quantity(float(count - len(missing)), "1", limit=ENOUGH_LABELS * count),
        labels=Quantity(float(count), "1"),
        name=Quantity(name),
        missing=Quantity(with_nearest(missing, 2)),
    )


def with_nearest(missing: Mapping[str, Sequence[str]], most: int = 4) -> str:
    """List the first of these labels, each with the most similar ones."""
    return first_few([f"{label} ({' or '.join(near)}?)" if near else label for label, near in missing.items()], most)


def nearest_labels(missing: Sequence[str], labels: Sequence[str]) -> dict[str, list[str]]:
    """Return the most similar labels for each missing label."""
    known: dict[str, str] = {}
    for label in labels:
        known.setdefault(folded(label), label)
    return {
        label: [known[near] for near in difflib.get_close_matches(folded(label), list(known), n=2, cutoff=0.6)]
        for label in missing
    }


def in_words(name: str) -> str:
    """Return the everyday name of a landmark, joint or segment of one side.

    >>> in_words("knee_r")
    'right knee'
    """
    head, _, side = name.rpartition("_")
    return f"{SIDE_NAMES[side]} {head.replace('_', ' ')}" if side in SIDE_NAMES else name


@cache
def folded(label: str) -> str:
    """Return the letters and digits of a label, in lower case."""
    return "".join(ch for ch in label.lower() if ch.isalnum())
