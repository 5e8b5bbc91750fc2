"""Drafts a first marker set from a standing person's recording: `kinertia markers`.

Markers are placed by geometry, with their labels as hints. Where no one stands, labels alone decide, going by the same
or similar names in the presets (`R.Knee`, `RKNE`, `r_knee_study`); other labels are listed to be placed by hand.
"""

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from kinertia.errors import MarkerSetError
from kinertia.io.marker_positions.placement import Placement, place_markers
from kinertia.io.marker_set_file import marker_set_of, nearest_preset, preset_names, read_marker_set
from kinertia.io.text.toml_lines import quoted
from kinertia.model.gait27 import build_gait27
from kinertia.model.joint_centres import find_landmarks
from kinertia.model.marker_set import LANDMARKS, SEGMENTS, WIDTHS, MarkerSet, folded, label_share
from kinertia.model.static_landmarks import departures, with_alignment_device
from kinertia.trial.data import Recording

_NEAR = 0.85
_ANY_WIDTH_M, _USUAL_HEIGHT_M = 0.09, 1.7
"""Whether landmarks suffice depends on neither."""
_LEG = ("asis", "knee_lateral", "ankle_lateral", "heel", "metatarsal")
_WIDTHS = """# Joints without a medial marker: the widths in the PROCESSING group of the static C3D file, by its names.
# For other files give them as knee_width_mm and so on under [subject] of a subject file."""
_NEEDED = tuple(name for name in LANDMARKS if not name.startswith(("thigh_wand", "shank_wand", "head_top")))


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
    notes = [*placed.notes, *(f"this cannot be right: {one}" for one in against)]
    heading = [
        "# Drafted by kinertia markers: check every line, complete those marked FILL IN, and name the file with",
        "# --markers or under [model] markers.",
        *(f"# NOTE: {note}." for note in notes),
    ]
    text = marker_set_text(name, landmarks, segments, widths, labels, "\n".join(heading), placed.how)
    out = [f"#   {label}: {reason}" for label, reason in placed.left_out.items()]
    text += "\n".join(["", "# Not markers on the skin:", *out, ""] if out else [])
    needed = [f"{one}_{side}" for one in _LEG for side in "rl"]
    if "sacrum" not in landmarks:
        needed += ["psis_r", "psis_l"]
    return MarkerSetDraft(text, tuple(one for one in needed if one not in landmarks), tuple(notes), against)


def _against(
    recording: Recording, landmarks: Mapping[str, Sequence[str]], widths: Mapping[str, str]
) -> tuple[str, ...]:
    """List what no person has in legs with these landmarks, with any joint widths; nothing where some are missing."""
    found = MarkerSet("draft", {name: tuple(own) for name, own in landmarks.items()}, {}, dict(widths))
    known = dict.fromkeys(widths.values(), _ANY_WIDTH_M) | recording.measurements
    try:
        marks = find_landmarks(replace(recording, measurements=known), found)
        return tuple(one.sentence for one in departures(marks))
    except MarkerSetError:
        return ()


def _widths(landmarks: Mapping[str, Sequence[str]], recording: Recording) -> dict[str, str]:
    """Return widths of joints with only a lateral marker: their name in the file, or one that it does not have."""
    widths = {}
    for joint in WIDTHS:
        base, _, side = joint.rpartition("_")
        if f"{base}_lateral_{side}" in landmarks and f"{base}_medial_{side}" not in landmarks:
            name = f"{side.upper()}{base.capitalize()}Width"
            known = {one.lower(): one for one in recording.measurements}
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


def marker_set_text(
    name: str,
    landmarks: Mapping[str, Sequence[str]],
    segments: Mapping[str, Sequence[str]],
    widths: Mapping[str, str],
    labels: Sequence[str],
    heading: str,
    how: Mapping[str, str] | None = None,
) -> str:
    """Return the text of a marker set (TOML); labels and entries that it lacks are in comments."""
    lines = [heading, f"name = {quoted(name)}", "", "[landmarks]"]
    for landmark in LANDMARKS:
        own = landmarks.get(landmark)
        if own:
            reason = "" if how is None or landmark not in how else f"  # {how[landmark]}"
            lines.append(f"{landmark} = {_listed(own)}{reason}")
        elif landmark in _NEEDED:
            lines.append(f'# {landmark} = ""  # FILL IN, if there is one')
    lines += ["", "[segments]"]
    for segment in SEGMENTS:
        if own := segments.get(segment):
            lines.append(f"{segment} = {_listed(own)}")
        else:
            lines.append(f"# {segment} = []  # FILL IN")
    if widths:
        lines += ["", _WIDTHS, "[widths]", *(f"{joint} = {quoted(width)}" for joint, width in widths.items())]
    placed = {label for own in segments.values() for label in own}
    rest = [label for label in labels if label not in placed]
    if rest:
        lines += ["", f"# Not placed; FILL IN where they belong: {', '.join(rest)}"]
    return "\n".join(lines) + "\n"


def _listed(labels: Sequence[str]) -> str:
    return "[" + ", ".join(map(quoted, labels)) + "]"


def _names(table: str, labels: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield names of labels in the presets, folded, and entries of this table; the preset most like these labels comes
    last and so takes precedence.
    """
    presets = map(read_marker_set, preset_names())
    for preset in sorted(presets, key=lambda preset: (label_share(preset, labels), len(preset.labels))):
        entries = preset.landmarks if table == "landmarks" else preset.segments
        for entry, own in entries.items():
            # a landmark of several labels is their middle, none of them alone
            yield from ((folded(label), entry) for label in own if table == "segments" or len(own) == 1)


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
