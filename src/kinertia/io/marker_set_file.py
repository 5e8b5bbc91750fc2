"""Reads marker sets from TOML files, the package's presets and a user's own of the same form; words such files.

Copy one from `src/kinertia/io/marker_sets/` and change it.
"""

import difflib
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path

from kinertia.errors import FileError, expect_file
from kinertia.findings.extensions import MARKER_SETS, loaded, names
from kinertia.findings.quantity import Quantity
from kinertia.io.text.toml_lines import TomlFile, parse_toml, quoted, read_toml
from kinertia.model.marker_set import (
    LANDMARKS,
    SEGMENTS,
    WIDTHS,
    MarkerSet,
    fits_person,
    label_share,
    mismatch,
    spelled_as,
    with_posterior_pelvis,
    without_computed_sacrum,
)
from kinertia.trial.data import Markers

_WIDTHS = """# Joints without a medial marker: the widths in the PROCESSING group of the static C3D file, by its names.
# For other files give them as knee_width_mm and so on under [subject] of a subject file."""
_NEEDED = tuple(name for name in LANDMARKS if not name.startswith(("thigh_wand", "shank_wand", "head_top")))


@cache
def preset_names() -> tuple[str, ...]:
    """Return the names of the marker sets that come with the package, or with installed packages that extend it."""
    return tuple(sorted({*_own_names(), *names(MARKER_SETS)}))


@cache
def _own_names() -> tuple[str, ...]:
    folder = resources.files("kinertia.io") / "marker_sets"
    return tuple(Path(entry.name).stem for entry in folder.iterdir() if entry.name.endswith(".toml"))


def read_marker_set(name: str | Path) -> MarkerSet:
    """Read a preset by its name, or a user's own marker set from a TOML file.

    Raises:
        FileError: no such preset or file, or the file is not a marker set.
    """
    if str(name) in preset_names():
        return _preset(str(name))
    path = Path(name)
    expect_file(path, f"a TOML file, or one of the presets {', '.join(preset_names())}")
    return _marker_set(read_toml(path, "a marker set"), path)


@cache
def _preset(name: str) -> MarkerSet:
    if name not in _own_names():
        added = Path(loaded(MARKER_SETS, name))
        return _marker_set(read_toml(added, "a marker set"), added)
    path = Path(f"{name}.toml")
    text = (resources.files("kinertia.io") / "marker_sets" / path).read_text(encoding="utf-8")
    return _marker_set(parse_toml(text, path), path)


def preset_name(marker_set: MarkerSet) -> str:
    """Return the name by which a preset is called in a subject file; empty for another set."""
    return next((name for name in preset_names() if read_marker_set(name).name == marker_set.name), "")


def choose_marker_set(labels: Sequence[str]) -> MarkerSet:
    """Choose the preset that fits the labels of a static trial, or of a trial of pelvis and legs only.

    Raises:
        MarkerSetError: no preset fits (L101); with what the nearest one lacks, and similar labels.
    """
    best = nearest_preset(labels)
    if not fits_person(best, labels):
        raise mismatch(best, labels)
    return best


def marker_set_of(markers: Markers, named: MarkerSet | None = None) -> MarkerSet:
    """Return the preset that fits these markers, or the set that the user chose, with the posterior pelvis they show.

    Raises:
        MarkerSetError: no preset fits (L101).
    """
    chosen = choose_marker_set(markers.labels) if named is None else with_posterior_pelvis(named, markers.labels)
    return without_computed_sacrum(chosen, markers)


def nearest_preset(labels: Sequence[str]) -> MarkerSet:
    """Return the preset nearest to the labels: of presets that the labels cover except for trunk and arms, the one with
    most labels, exact spelling before `spelled_as`; else the one that shares most of its labels, in the same order of
    preference; of nested presets the larger. If it fits, it takes the spelling of the labels.
    """
    read = [read_marker_set(name) for name in preset_names()]
    presets = [with_posterior_pelvis(preset, labels) for preset in read]
    spelled = [with_posterior_pelvis(spelled_as(preset, labels), labels) for preset in read]

    def worn(preset: MarkerSet) -> int:
        return len(set(preset.labels) & set(labels)) if fits_person(preset, labels) else 0

    def nearness(k: int) -> tuple[float, ...]:
        both = presets[k], spelled[k]
        return (
            *(worn(candidate) for candidate in both),
            *(label_share(candidate, labels) for candidate in both),
            len(presets[k].labels),
        )

    best = max(range(len(presets)), key=nearness)
    return spelled[best] if fits_person(spelled[best], labels) else presets[best]


def _marker_set(document: TomlFile, path: Path) -> MarkerSet:
    content = document.content
    known = {"name": None, "landmarks": LANDMARKS, "segments": SEGMENTS, "widths": WIDTHS, "spellings": ()}
    for table, entries in content.items():
        if table not in known:
            raise _wrong(path, document.line((table,)), f"unknown entry '{table}'; it has {', '.join(known)}")
        names = known[table]
        if names is None:
            continue
        if not isinstance(entries, dict):
            raise _wrong(path, document.line((table,)), f"'{table}' must be a table, [{table}]")
        for entry, value in entries.items():
            _check_entry(path, document, table, entry, value, names)
    segments = {segment: _labels(content.get("segments", {}).get(segment, ())) for segment in SEGMENTS}
    if len(segments["pelvis"]) < 3:
        line = document.line(("segments", "pelvis"))
        raise _wrong(path, line, "[segments] pelvis must list at least three markers")
    for side in ("asis_r", "asis_l"):
        if side not in content.get("landmarks", {}):
            problem = f"[landmarks] lacks {side}, which defines the pelvis frame and the heading"
            raise _wrong(path, document.line(("landmarks",)), problem)
    return MarkerSet(
        name=str(content.get("name", path.stem)),
        landmarks={key: _labels(value) for key, value in content.get("landmarks", {}).items()},
        segments=segments,
        widths=dict(content.get("widths", {})),
        spellings={key: _labels(value) for key, value in content.get("spellings", {}).items()},
    )


def _check_entry(path: Path, document: TomlFile, table: str, entry: str, value: object, names: Sequence[str]) -> None:
    if names and entry not in names:
        near = difflib.get_close_matches(entry, names, n=1)
        hint = f"the nearest is {near[0]}" if near else f"known are {', '.join(names)}"
        raise _wrong(path, document.line((table, entry)), f"unknown [{table}] entry '{entry}'; {hint}")
    items = value if isinstance(value, list) else [value]
    if not items or not all(isinstance(item, str) and item for item in items):
        what = f"[{table}] {entry} must be a label or a list of labels, not {value!r}"
        raise _wrong(path, document.line((table, entry)), what)


def _wrong(path: Path, line: int | None, problem: str) -> FileError:
    return FileError.found(path, "F186", line, problem=Quantity(problem))


def _labels(value: str | Sequence[str]) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else tuple(value)


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
        landmark_labels = landmarks.get(landmark)
        if landmark_labels:
            reason = "" if how is None or landmark not in how else f"  # {how[landmark]}"
            lines.append(f"{landmark} = {_listed(landmark_labels)}{reason}")
        elif landmark in _NEEDED:
            lines.append(f'# {landmark} = ""  # FILL IN, if there is one')
    lines += ["", "[segments]"]
    for segment in SEGMENTS:
        if landmark_labels := segments.get(segment):
            lines.append(f"{segment} = {_listed(landmark_labels)}")
        else:
            lines.append(f"# {segment} = []  # FILL IN")
    if widths:
        lines += ["", _WIDTHS, "[widths]", *(f"{joint} = {quoted(width)}" for joint, width in widths.items())]
    placed = {label for segment_labels in segments.values() for label in segment_labels}
    rest = [label for label in labels if label not in placed]
    if rest:
        lines += ["", f"# Not placed; FILL IN where they belong: {', '.join(rest)}"]
    return "\n".join(lines) + "\n"


def _listed(labels: Sequence[str]) -> str:
    return "[" + ", ".join(map(quoted, labels)) + "]"
