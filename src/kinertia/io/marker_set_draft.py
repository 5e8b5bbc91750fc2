"""Drafts a first marker set: assigns the markers of a standing person to landmarks and segments, with reasons.

Markers are placed by geometry, with their labels as hints. Where no one stands, labels alone decide, going by the same
or similar names in the presets (`R.Knee`, `RKNE`, `r_knee_study`); other labels are listed to be placed by hand.
"""

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kinertia.errors import MarkerSetError
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
from kinertia.io.marker_set_file import marker_set_of, marker_set_text, nearest_preset, preset_names, read_marker_set
from kinertia.model.gait27 import build_gait27
from kinertia.model.joint_centres import find_landmarks
from kinertia.model.marker_set import WIDTHS, MarkerSet, folded, label_share
from kinertia.model.static_landmarks import departures, device_labels, with_alignment_device
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
_NEAR = 0.85
_ANY_WIDTH_M, _USUAL_HEIGHT_M = 0.09, 1.7
"""Whether landmarks suffice depends on neither."""
_LEG = ("asis", "knee_lateral", "ankle_lateral", "heel", "metatarsal")


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
    body, found, margin = max(
        (_best_body(markers.labels, posture, computed, pairs) for posture in postures), key=_score
    )
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
    labels, points = tuple(label for label, is_shown in zip(labels, shown, strict=True) if is_shown), points[shown]
    meant = tuple(roles(label, label in pairs) for label in labels)
    worn = np.array([label not in computed for label in labels])
    trust = np.where(worn, 0.0, np.where([bool(meanings) for meanings in meant], _COMPUTED, -np.inf))
    axes = body_axes(points[worn])
    others = tuple(
        labels.index(pairs[label][1]) if label in pairs and pairs[label][1] in labels else -1 for label in labels
    )
    fits = []
    for turned_axes in (axes, axes.turned()):
        places = turned_axes.places(points)
        side, mirrored = _label_sides(labels, places, pairs)
        bodies = [
            StandingBody(labels, places, float(stature_m), meant, trust, side, others, mirrored)
            for stature_m in _STATURES_M
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
        across[label] - across[left_label]
        for label, (side, left_label) in pairs.items()
        if side == "r" and {label, left_label} <= set(across)
    ]
    mirrored = sum(np.sign(apart_m) for apart_m in apart if abs(apart_m) > _APART_M) < 0
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
        of_landmark |= {
            name: markers for name, markers in ((f"metatarsal_{side}", heads), (f"wrist_{side}", wrist)) if markers
        }
        if heads:
            result.how[f"metatarsal_{side}"] = which
    members = segment_members(body, found)
    of_landmark |= wands(body, found, members)
    how = {}
    for landmark, markers in of_landmark.items():
        name = _on_side(body, landmark, markers)
        result.landmarks[name] = [body.labels[k] for k in markers]
        how[name] = "; ".join(filter(None, (result.how.get(landmark), _how(body, landmark, markers, computed))))
    result.how.clear()
    result.how.update(how)
    for marker, segment in members.items():
        label = body.labels[marker]
        if label not in computed:
            result.segments.setdefault(_on_side(body, segment, [marker]), []).append(label)
    result.left_out.update(computed)


def _complete_by_label(result: Placement, pairs: Mapping[str, tuple[str, str]]) -> None:
    """Add to the other side what was found on one side only, if its markers have counterparts by label."""
    placed = {label for labels in (*result.landmarks.values(), *result.segments.values()) for label in labels}

    def counterparts(labels: Sequence[str]) -> list[str]:
        there = [pairs[label][1] for label in labels if label in pairs]
        return [label for label in there if label not in placed and label not in result.left_out]

    for name, labels in list(result.landmarks.items()):
        base, _, side = name.rpartition("_")
        other = f"{base}_{_OPPOSITE.get(side)}"
        there = counterparts(labels)
        if side in _OPPOSITE and other not in result.landmarks and len(there) == len(labels):
            result.landmarks[other] = there
            result.how[other] = "as on the other side, going by its label"
    for name, labels in list(result.segments.items()):
        base, _, side = name.rpartition("_")
        if side in _OPPOSITE and (there := counterparts(labels)):
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


@dataclass(frozen=True)
class MarkerSetDraft:
    """Draft of a marker set for a recording.

    Attributes:
        text: TOML; what is unknown, and why, is in comments.
        needed: landmarks that were not found, and without which no leg can be modelled.
        notes: remarks to read before using it.
        against: why it cannot be right: axes of its legs that no person has (`static_landmarks`). Such a draft is not
            used unless the user asks for it.
    """

    text: str
    needed: tuple[str, ...]
    notes: tuple[str, ...]
    against: tuple[str, ...]


def preset_of(static: Recording) -> MarkerSet | None:
    """Return the preset that can make a model of this static trial, with any joint widths; None if none can."""
    labels = static.markers.labels
    preset = nearest_preset(labels)
    widths = dict.fromkeys(preset.widths.values(), _ANY_WIDTH_M) | static.measurements
    try:
        found = with_alignment_device(marker_set_of(static.markers), labels)
        build_gait27(replace(static, measurements=widths), found, _USUAL_HEIGHT_M, "male")
    except MarkerSetError:
        return None
    return preset


def draft_marker_set(recording: Recording, name: str) -> MarkerSetDraft:
    """Draft a marker set with this name for a recording, ideally a static trial."""
    placed = places_of(recording)
    labels = [label for label in recording.markers.labels if label not in placed.left_out]
    landmarks, segments = placed.landmarks, placed.segments
    widths = _widths(landmarks, recording)
    against = _against(recording, landmarks, widths)
    notes = [*placed.notes, *(f"this cannot be right: {reason}" for reason in against)]
    heading = [
        "# Drafted by kinertia markers: check every line, complete those marked FILL IN, and name the file with",
        "# --markers or under [model] markers.",
        *(f"# NOTE: {note}." for note in notes),
    ]
    text = marker_set_text(name, landmarks, segments, widths, labels, "\n".join(heading), placed.how)
    out = [f"#   {label}: {reason}" for label, reason in placed.left_out.items()]
    text += "\n".join(["", "# Not markers on the skin:", *out, ""] if out else [])
    needed = [f"{landmark}_{side}" for landmark in _LEG for side in "rl"]
    if "sacrum" not in landmarks:
        needed += ["psis_r", "psis_l"]
    return MarkerSetDraft(
        text, tuple(landmark for landmark in needed if landmark not in landmarks), tuple(notes), against
    )


def _against(
    recording: Recording, landmarks: Mapping[str, Sequence[str]], widths: Mapping[str, str]
) -> tuple[str, ...]:
    """List what no person has in legs with these landmarks, with any joint widths; nothing where some are missing."""
    found = MarkerSet("draft", {name: tuple(labels) for name, labels in landmarks.items()}, {}, dict(widths))
    known = dict.fromkeys(widths.values(), _ANY_WIDTH_M) | recording.measurements
    try:
        marks = find_landmarks(replace(recording, measurements=known), found)
        return tuple(departure.sentence for departure in departures(marks))
    except MarkerSetError:
        return ()


def _widths(landmarks: Mapping[str, Sequence[str]], recording: Recording) -> dict[str, str]:
    """Return widths of joints with only a lateral marker: their name in the file, or one that it does not have."""
    widths = {}
    for joint in WIDTHS:
        base, _, side = joint.rpartition("_")
        if f"{base}_lateral_{side}" in landmarks and f"{base}_medial_{side}" not in landmarks:
            name = f"{side.upper()}{base.capitalize()}Width"
            known = {measurement.lower(): measurement for measurement in recording.measurements}
            if base != "elbow" or name.lower() in known:  # elbows have a width by the stature
                widths[joint] = known.get(name.lower(), name)
    return widths


def places_of(recording: Recording) -> Placement:
    """Locate the markers on the body by geometry or, if no one stands, by the labels that are known."""
    placed = place_markers(recording)
    if placed.landmarks:
        return placed
    labels = [label for label in recording.markers.labels if label not in placed.left_out]
    landmarks, segments = known_places(labels)
    return replace(placed, landmarks=landmarks, segments=segments)


def known_places(labels: Sequence[str]) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Return landmarks and segments with the labels that are known by name."""
    landmarks = _placed(labels, dict(_names("landmarks", labels)), single=True)
    return landmarks, _placed(labels, dict(_names("segments", labels)), single=False)


def _names(table: str, labels: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield names of labels in the presets, folded, and entries of this table; the preset most like these labels comes
    last and so takes precedence.
    """
    presets = map(read_marker_set, preset_names())
    for preset in sorted(presets, key=lambda preset: (label_share(preset, labels), len(preset.labels))):
        entries = preset.landmarks if table == "landmarks" else preset.segments
        for entry, entry_labels in entries.items():
            # a landmark of several labels is their middle, none of them alone
            yield from (
                (folded(label), entry) for label in entry_labels if table == "segments" or len(entry_labels) == 1
            )


def _placed(labels: Sequence[str], names: Mapping[str, str], single: bool) -> dict[str, list[str]]:
    """Return entry -> labels, exact names first."""
    placed: dict[str, list[str]] = {}
    exact = {label: names[folded(label)] for label in labels if folded(label) in names}
    near = {label: _nearest(label, names) for label in labels if label not in exact}
    for label, entry in (*exact.items(), *near.items()):
        if entry is not None and not (single and entry in placed):
            placed.setdefault(entry, []).append(label)
    return placed


def _nearest(label: str, names: Mapping[str, str]) -> str | None:
    """Return the entry of the name most similar to the label, on the same side if it has one."""
    side = folded(label)[:1]
    alike = [name for name in names if name[:1] == side]
    near = difflib.get_close_matches(folded(label), alike, n=1, cutoff=_NEAR)
    return names[near[0]] if near else None
