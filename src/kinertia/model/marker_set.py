"""`MarkerSet`: which of a laboratory's labels is which landmark, and which markers move with which segment.

Only this knows a laboratory's names (DESIGN section 4). A marker set is a TOML file; three come with the package, and
a user's own has the same form (copy one from `src/kinertia/model/marker_sets/`).
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from kinertia.errors import FileError, MarkerSetError

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
WIDTHS = tuple(f"{name}_{side}" for name in ("knee", "ankle", "elbow") for side in "rl")


@dataclass(frozen=True)
class MarkerSet:
    """Landmarks and segment markers by a laboratory's labels.

    Attributes:
        name: for messages.
        landmarks: landmark -> the labels whose mean it is.
        segments: segment -> labels of the markers that move with it.
        widths: joint -> name of a measurement (m) that comes with the static file.
    """

    name: str
    landmarks: Mapping[str, tuple[str, ...]]
    segments: Mapping[str, tuple[str, ...]]
    widths: Mapping[str, str]

    @property
    def labels(self) -> tuple[str, ...]:
        """All labels, each once."""
        named = [label for labels in (*self.segments.values(), *self.landmarks.values()) for label in labels]
        return tuple(dict.fromkeys(named))

    def foot_labels(self) -> dict[str, list[str]]:
        """Labels of the markers on the right ("r") and left ("l") foot."""
        return {side: list(self.segments[f"foot_{side}"]) for side in "rl"}


def preset_names() -> list[str]:
    """Names of the marker sets that come with the package."""
    folder = resources.files("kinertia.model") / "marker_sets"
    return sorted(Path(entry.name).stem for entry in folder.iterdir() if entry.name.endswith(".toml"))


def read_marker_set(name: str | Path) -> MarkerSet:
    """A preset by its name, or a user's own from a TOML file.

    Raises:
        FileError: no such preset or file, or the file is not a marker set.
    """
    if str(name) in preset_names():
        text = (resources.files("kinertia.model") / "marker_sets" / f"{name}.toml").read_text(encoding="utf-8")
        return _parse(text, Path(f"{name}.toml"))
    path = Path(name)
    if not path.is_file():
        raise FileError(path, f"no such marker set; give a TOML file or one of the presets {', '.join(preset_names())}")
    return _parse(path.read_text(encoding="utf-8"), path)


def choose_marker_set(labels: Sequence[str]) -> MarkerSet:
    """The preset that fits the labels of a static trial.

    Raises:
        MarkerSetError: no preset fits; says for the best one what is missing and the nearest labels.
    """
    best = nearest_preset(labels)
    if _share(best, labels) < 0.8:
        raise _mismatch(best, labels, "no marker-set preset fits the static trial; the nearest is")
    return best


def nearest_preset(labels: Sequence[str]) -> MarkerSet:
    """The preset that shares most of its labels with these, be it many or few."""
    return max(map(read_marker_set, preset_names()), key=lambda preset: _share(preset, labels))


def check_marker_set(marker_set: MarkerSet, labels: Sequence[str]) -> None:
    """Raise MarkerSetError when a marker set that the user named does not belong to these labels."""
    if _share(marker_set, labels) < 0.5:
        raise _mismatch(marker_set, labels, "the static trial does not carry the marker set")


def _share(marker_set: MarkerSet, labels: Sequence[str]) -> float:
    wanted = set(marker_set.labels)
    return len(wanted & set(labels)) / len(wanted)


def _mismatch(marker_set: MarkerSet, labels: Sequence[str], what: str) -> MarkerSetError:
    missing = [label for label in marker_set.labels if label not in labels]
    nearest = nearest_labels(missing, labels)
    listed = ", ".join(label + _hint(nearest[label]) for label in missing)
    return MarkerSetError(
        f"{what} '{marker_set.name}', which lacks {len(missing)} of {len(marker_set.labels)} labels: {listed}; "
        f"write a marker set of your own as TOML and name it under [model] markers",
        missing,
        nearest,
    )


def nearest_labels(missing: Sequence[str], labels: Sequence[str]) -> dict[str, list[str]]:
    """For each missing label the labels that look most like it."""
    folded: dict[str, str] = {}
    for label in labels:
        folded.setdefault(_fold(label), label)
    return {
        label: [folded[near] for near in difflib.get_close_matches(_fold(label), list(folded), n=2, cutoff=0.6)]
        for label in missing
    }


def _hint(near: Sequence[str]) -> str:
    return f" (nearest: {' or '.join(near)})" if near else ""


def _fold(label: str) -> str:
    return "".join(ch for ch in label.lower() if ch.isalnum())


def _parse(text: str, path: Path) -> MarkerSet:
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(path, f"not valid TOML: {error}") from error
    known = {"name": None, "landmarks": LANDMARKS, "segments": SEGMENTS, "widths": WIDTHS}
    for table, entries in content.items():
        if table not in known:
            raise FileError(path, f"unknown entry '{table}'; a marker set has {', '.join(known)}", _line(text, table))
        names = known[table]
        if names is None:
            continue
        if not isinstance(entries, dict):
            raise FileError(path, f"'{table}' must be a table, [{table}]", _line(text, table))
        for entry, value in entries.items():
            _check_entry(path, text, table, entry, value, names)
    segments = {segment: _labels(content.get("segments", {}).get(segment, ())) for segment in SEGMENTS}
    if len(segments["pelvis"]) < 3:
        raise FileError(path, "[segments] pelvis must list at least three markers")
    for side in ("asis_r", "asis_l"):
        if side not in content.get("landmarks", {}):
            raise FileError(
                path, f"[landmarks] must name {side}: it makes the pelvis frame, and tells which way one faces"
            )
    return MarkerSet(
        name=str(content.get("name", path.stem)),
        landmarks={key: _labels(value) for key, value in content.get("landmarks", {}).items()},
        segments=segments,
        widths=dict(content.get("widths", {})),
    )


def _check_entry(path: Path, text: str, table: str, entry: str, value: object, names: Sequence[str]) -> None:
    line = _line(text, entry)
    if entry not in names:
        near = difflib.get_close_matches(entry, names, n=1)
        hint = f"; did you mean {near[0]}?" if near else f"; known: {', '.join(names)}"
        raise FileError(path, f"unknown [{table}] entry '{entry}'{hint}", line)
    items = value if isinstance(value, list) else [value]
    if not items or not all(isinstance(item, str) and item for item in items):
        raise FileError(path, f"[{table}] {entry} must be a label or a list of labels, not {value!r}", line)


def _labels(value: str | Sequence[str]) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else tuple(value)


def _line(text: str, key: str) -> int | None:
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip().lstrip("[").startswith(key):
            return number
    return None
