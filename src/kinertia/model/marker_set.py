"""`MarkerSet`: which of a laboratory's labels is which landmark, and which markers move with which segment.

Only this knows a laboratory's names. Marker sets come from files (`kinertia.io.marker_set_file`).
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from kinertia.errors import MarkerSetError
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
ENOUGH_WORN = 0.8
"""Share of a preset's labels, or of those of its pelvis, legs and feet, from which on a recording has it."""
_LEGS = ("pelvis", "thigh", "shank", "foot")
WIDTHS = tuple(f"{name}_{side}" for name in ("knee", "ankle", "elbow") for side in "rl")


@dataclass(frozen=True)
class MarkerSet:
    """Landmarks and segment markers by a laboratory's labels.

    Attributes:
        name: for messages.
        landmarks: landmark -> the labels whose mean it is.
        segments: segment -> labels of the markers that move with it.
        widths: joint -> name of a measurement (m) that comes with the static file.
        in_model: one frame, where an OpenSim model has them in its default pose; None for a laboratory's.

    Examples:
        >>> kinertia.read_marker_set("plug-in-gait").foot_labels()["r"]
        ['RHEE', 'RTOE']
    """

    name: str
    landmarks: Mapping[str, tuple[str, ...]]
    segments: Mapping[str, tuple[str, ...]]
    widths: Mapping[str, str]
    in_model: Markers | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """All labels, each once."""
        named = [label for labels in (*self.segments.values(), *self.landmarks.values()) for label in labels]
        return tuple(dict.fromkeys(named))

    def foot_labels(self) -> dict[str, list[str]]:
        """Labels of the markers on the right ("r") and left ("l") foot."""
        return {side: list(self.segments[f"foot_{side}"]) for side in "rl"}


def spelled_as(marker_set: MarkerSet, labels: Sequence[str]) -> MarkerSet:
    """The set with the labels that these lack spelled as these are, where capitals and punctuation alone tell them
    apart, and one label only comes into question; its name says so.

    Args:
        marker_set: whose labels somebody may have typed anew, or a program has changed.
        labels: of a recording.
    """
    wanted = [label for label in marker_set.labels if label not in labels]
    others = [label for label in labels if label not in marker_set.labels]
    own = Counter(map(folded, others)) + Counter(map(folded, wanted))
    place = {folded(label): label for label in others}
    spelled = {label: place[folded(label)] for label in wanted if folded(label) in place and own[folded(label)] == 2}
    if not spelled:
        return marker_set
    label, written = next(iter(spelled.items()))
    more = f" and {len(spelled) - 1} more alike" if len(spelled) > 1 else ""

    def respelled(entries: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        return {name: tuple(spelled.get(one, one) for one in each) for name, each in entries.items()}

    return replace(
        marker_set,
        name=f"{marker_set.name} ({written} taken as {label}{more})",
        landmarks=respelled(marker_set.landmarks),
        segments=respelled(marker_set.segments),
    )


def check_marker_set(marker_set: MarkerSet, labels: Sequence[str]) -> None:
    """Raise MarkerSetError when a marker set that the user named does not belong to these labels."""
    if share_worn(marker_set, labels) < 0.5:
        raise mismatch(marker_set, labels, "the static trial does not carry the marker set")


def share_worn(marker_set: MarkerSet, labels: Sequence[str]) -> float:
    """Share of the set's labels that are among these."""
    wanted = set(marker_set.labels)
    return len(wanted & set(labels)) / len(wanted)


def is_worn(marker_set: MarkerSet, labels: Sequence[str]) -> bool:
    """Whether these labels are the set's, hardly one of them missing: its own, or those of its pelvis, legs and feet.

    Without trunk and arms a set still makes a model (`unobserved_segments`), without legs it does not.
    """
    return share_worn(marker_set, labels) >= ENOUGH_WORN or _legs_worn(marker_set, labels) >= ENOUGH_WORN


def _legs_worn(marker_set: MarkerSet, labels: Sequence[str]) -> float:
    """Share of the labels of pelvis, legs and feet that are among these."""
    legs = {label for name in SEGMENTS if name.startswith(_LEGS) for label in marker_set.segments[name]}
    return len(legs & set(labels)) / len(legs)


def mismatch(marker_set: MarkerSet, labels: Sequence[str], what: str) -> MarkerSetError:
    """The error that lists what the labels lack of a set; `what` begins its sentence."""
    missing = [label for label in marker_set.labels if label not in labels]
    nearest = nearest_labels(missing, labels)
    listed = ", ".join(label + _hint(nearest[label]) for label in missing)
    return MarkerSetError(
        f"{what} '{marker_set.name}', which lacks {len(missing)} of {len(marker_set.labels)} labels: {listed}; "
        f"write a marker set of your own as TOML (kinertia markers FILE -o SET.toml drafts it) and name it under "
        f"[model] markers",
        missing,
        nearest,
    )


def nearest_labels(missing: Sequence[str], labels: Sequence[str]) -> dict[str, list[str]]:
    """For each missing label the labels that look most like it."""
    known: dict[str, str] = {}
    for label in labels:
        known.setdefault(folded(label), label)
    return {
        label: [known[near] for near in difflib.get_close_matches(folded(label), list(known), n=2, cutoff=0.6)]
        for label in missing
    }


def _hint(near: Sequence[str]) -> str:
    return f" (nearest: {' or '.join(near)})" if near else ""


def folded(label: str) -> str:
    """Its letters and digits, in lower case."""
    return "".join(ch for ch in label.lower() if ch.isalnum())
