"""Assigns markers of a standing person to landmarks and segments, with the reason for each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kinertia.io.marker_positions.computed_points import computed_points, roles, sides, unusable_points
from kinertia.io.marker_positions.landmark_search import (
    Found,
    find_legs,
    find_upper_body,
    metatarsals,
    segment_members,
    wands,
)
from kinertia.io.marker_positions.standing_body import WHERE, StandingBody, body_axes
from kinertia.model.static_landmarks import device_labels
from kinertia.trial.data import FloatArray, Markers, Recording
from kinertia.trial.marker_quality import STILL_M_S, speed_m_s

_OFTEN = 0.25
"""Share of the frames in which a marker is seen that is used."""
_FEWEST = 8
_STATURES_M = np.geomspace(0.85, 2.1, 37)
_SURE, _CLEAR = 30.0, 6.0
"""Score of a person's legs, and by how much one heading must fit better than the other."""
_COMPUTED = -2.0
_POSTURES, _FULL = 7, 0.8
"""Number of frames of a moving person that are used, and the quantile of marker counts that they reach."""
_APART_M = 0.02
_OPPOSITE = {"r": "l", "l": "r"}


@dataclass(frozen=True)
class Placement:
    """Assignment of the markers of a recording to landmarks and segments.

    Attributes:
        landmarks: landmark -> labels whose mean it is.
        how: landmark -> how it was found.
        segments: segment -> labels that move with it.
        left_out: label -> reason why it is on no segment.
        notes: further remarks for the user.
    """

    landmarks: dict[str, list[str]] = field(default_factory=dict)
    how: dict[str, str] = field(default_factory=dict)
    segments: dict[str, list[str]] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def place_markers(recording: Recording) -> Placement:
    """Find the landmarks of a person who stands upright, by geometry with the labels as hints.

    Args:
        recording: a recording, ideally a static trial; in ground axes, Y up.

    Returns:
        the placement; without landmarks where the markers do not show a standing person.
    """
    markers = recording.markers
    left_out = {
        label: f"visible in only {share * 100:.0f} % of the frames"
        for label, share in zip(markers.labels, markers.seen.mean(axis=0), strict=True)
        if share <= _OFTEN
    }
    left_out |= dict.fromkeys(device_labels(markers.labels), "of a knee alignment device")
    markers = markers.select([label for label in markers.labels if label not in left_out])
    left_out |= unusable_points(markers)
    markers = markers.select([label for label in markers.labels if label not in left_out])
    computed = computed_points(markers)
    result = Placement(left_out=left_out)
    if len(markers.labels) - len(computed) < _FEWEST:
        result.notes.append("too few markers to place them")
        return result
    pairs, moves = sides(recording.markers.labels), speed_m_s(markers) > STILL_M_S
    postures = _frames(markers) if moves else [np.nanmedian(markers.positions, axis=0)]
    body, found, margin = max((_best_body(markers.labels, each, computed, pairs) for each in postures), key=_score)
    if found.score < _SURE:
        result.notes.append("no one stands upright here, so only the labels were used: give the static trial")
        return result
    if moves:
        result.notes.append("no one stands still here: the static trial shows the marker positions better")
    if margin < _CLEAR:
        result.notes.append("the heading of the person is unclear: check left and right")
    find_upper_body(body, found)
    _explain(result, body, found, computed)
    _complete_by_label(result, pairs)
    return result


def _frames(markers: Markers) -> list[FloatArray]:
    """Return positions (m, 3) in a few frames that show as many markers as any; missing markers are NaN."""
    count = markers.seen.sum(axis=1)
    full = np.flatnonzero(count >= np.quantile(count, _FULL))
    return [markers.positions[k] for k in full[:: -(-len(full) // _POSTURES)]]


def _best_body(
    labels: tuple[str, ...], points: FloatArray, computed: Mapping[str, str], pairs: Mapping[str, tuple[str, str]]
) -> tuple[StandingBody, Found, float]:
    """Return the heading and stature that fit points (m, 3) best, the landmarks found with them, and by how much they
    fit better than the opposite heading.
    """
    shown = np.asarray(np.isfinite(points).all(axis=1))
    labels, points = tuple(label for label, one in zip(labels, shown, strict=True) if one), points[shown]
    meant = tuple(roles(label, label in pairs) for label in labels)
    worn = np.array([label not in computed for label in labels])
    trust = np.where(worn, 0.0, np.where([bool(one) for one in meant], _COMPUTED, -np.inf))
    axes = body_axes(points[worn])
    others = tuple(labels.index(pairs[one][1]) if one in pairs and pairs[one][1] in labels else -1 for one in labels)
    fits = []
    for one in (axes, axes.turned()):
        places = one.places(points)
        side, mirrored = _label_sides(labels, places, pairs)
        bodies = [
            StandingBody(labels, places, float(each), meant, trust, side, others, mirrored) for each in _STATURES_M
        ]
        fits.append(max(((body, find_legs(body)) for body in bodies), key=_score))
    best = max(fits, key=_score)
    return *best, _score(best) - min(map(_score, fits))


def _score(fit: tuple[Any, ...]) -> float:
    found: Found = fit[1]
    return found.score


def _label_sides(
    labels: Sequence[str], places: FloatArray, pairs: Mapping[str, tuple[str, str]]
) -> tuple[tuple[str, ...], bool]:
    """Return the side stated by each label, and whether most labels contradict their positions."""
    across = {label: place[2] for label, place in zip(labels, places, strict=True)}
    apart = [
        across[one] - across[two] for one, (side, two) in pairs.items() if side == "r" and {one, two} <= set(across)
    ]
    mirrored = sum(np.sign(each) for each in apart if abs(each) > _APART_M) < 0
    return tuple(pairs[label][0] if label in pairs else "" for label in labels), bool(mirrored)


def _explain(result: Placement, body: StandingBody, found: Found, computed: Mapping[str, str]) -> None:
    """Record what was found in the result, on the sides stated by the labels."""
    if body.mirrored:
        result.notes.append(
            "right labels are on the person's left, judging by the feet: the axes may be mirrored; labels were kept"
        )
    of_landmark: dict[str, list[int]] = {}
    for landmark, marker in found.markers.items():
        if not landmark.startswith(("metatarsal", "wrist")):
            of_landmark[landmark] = [marker]
    notch = found.markers.get("sternal_notch")
    if notch is not None:  # of two clavicles the middle
        of_landmark["sternal_notch"] += [k for k in range(len(body.labels)) if body.other_side[k] == notch]
    for side in "rl":
        heads, which = metatarsals(found.markers, side)
        wrist = [found.markers[name] for name in (f"wrist_{side}", f"wrist_other_{side}") if name in found.markers]
        of_landmark |= {name: own for name, own in ((f"metatarsal_{side}", heads), (f"wrist_{side}", wrist)) if own}
        if heads:
            result.how[f"metatarsal_{side}"] = which
    members = segment_members(body, found)
    of_landmark |= wands(body, found, members)
    how = {}
    for landmark, own in of_landmark.items():
        name = _on_side(body, landmark, own)
        result.landmarks[name] = [body.labels[k] for k in own]
        how[name] = "; ".join(filter(None, (result.how.get(landmark), _how(body, landmark, own, computed))))
    result.how.clear()
    result.how.update(how)
    for marker, segment in members.items():
        label = body.labels[marker]
        if label not in computed:
            result.segments.setdefault(_on_side(body, segment, [marker]), []).append(label)
    result.left_out.update(computed)


def _complete_by_label(result: Placement, pairs: Mapping[str, tuple[str, str]]) -> None:
    """Add to the other side what was found on one side only, if its markers have counterparts by label."""
    placed = {label for own in (*result.landmarks.values(), *result.segments.values()) for label in own}

    def counterparts(own: Sequence[str]) -> list[str]:
        there = [pairs[label][1] for label in own if label in pairs]
        return [label for label in there if label not in placed and label not in result.left_out]

    for name, own in list(result.landmarks.items()):
        base, _, side = name.rpartition("_")
        other = f"{base}_{_OPPOSITE.get(side)}"
        there = counterparts(own)
        if side in _OPPOSITE and other not in result.landmarks and len(there) == len(own):
            result.landmarks[other] = there
            result.how[other] = "as on the other side, going by its label"
    for name, own in list(result.segments.items()):
        base, _, side = name.rpartition("_")
        if side in _OPPOSITE and (there := counterparts(own)):
            result.segments.setdefault(f"{base}_{_OPPOSITE[side]}", []).extend(there)


def _on_side(body: StandingBody, name: str, markers: Sequence[int]) -> str:
    """Put a landmark or segment on the side stated by the labels of these markers, else on that of their position."""
    base, _, side = name.rpartition("_")
    if side not in ("r", "l"):
        return name
    said = {body.side[k] for k in markers} - {""}
    if len(said) == 1:
        return f"{base}_{said.pop()}"
    return f"{base}_{_OPPOSITE[side] if body.mirrored else side}"


def _how(body: StandingBody, landmark: str, markers: Sequence[int], computed: Mapping[str, str]) -> str:
    """Describe in a few words how a landmark was found."""
    base = landmark[:-2] if landmark.endswith(("_r", "_l")) else landmark
    at = body.places[list(markers)].mean(axis=0)
    words = [WHERE[base], f"{at[1] * 100:.0f} cm above the floor"]
    hinted = all(base in body.meant[k] for k in markers)
    words.append("the label agrees" if hinted else "by its place alone")
    words += [f"computed ({computed[body.labels[k]]})" for k in markers if body.labels[k] in computed]
    if landmark.endswith(("_r", "_l")) and _on_side(body, landmark, markers) != landmark and not body.mirrored:
        words.append("ITS LABEL IS OF THE OTHER SIDE")
    return ", ".join(words)
