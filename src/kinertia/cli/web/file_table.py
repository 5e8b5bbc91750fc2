"""Lists the files of a person as a table to correct: a row per file, with its use.

The table is another view of the subject file: `file_table` makes it from the entries, `with_uses` the entries from it.
"""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from kinertia.errors import SettingsError
from kinertia.io.file_names import NEXUS_MEASURES, last_part
from kinertia.io.marker_set_file import preset_names
from kinertia.io.subject.body_files import is_measures_sheet
from kinertia.io.subject.draft import STATIC_NAME, has_force_columns, holds_loads, is_capture
from kinertia.io.subject.tables import TABLES
from kinertia.io.text.qualisys import is_plate_file

Content = dict[str, Any]
"""Entries of a subject file, as `tomllib` reads them."""
NOT_USED = ""
_MODEL_FILES = ("static", "osim", "markers")
_PRIOR_FILES = ("bsp", "measures")


@dataclass(frozen=True)
class FileRow:
    """One file of a person, with its use.

    Attributes:
        name: name of the file.
        kind: its content, in words.
        use: its use, one of `choices`.
        choices: possible uses and their words.
        size: size in bytes.
    """

    name: str
    kind: str
    use: str
    choices: tuple[tuple[str, str], ...]
    size: int


def file_table(files: Sequence[Path], content: Content) -> list[FileRow]:
    """Return a row per file; uses as the entries of the subject file have them."""
    captures = [file for file in files if is_capture(file)]
    uses = uses_of(content)
    rows = []
    for file in files:
        kind, choices = _kind(file, file in captures, captures)
        use = uses.get(file.name, NOT_USED)
        known = use if use in dict(choices) else NOT_USED
        rows.append(FileRow(file.name, kind, known, choices, file.stat().st_size))
    return rows


def _kind(file: Path, capture: bool, captures: Sequence[Path]) -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return what a file holds, and its possible uses."""
    suffix = file.suffix.lower()
    unused = (NOT_USED, "not used")
    if is_plate_file(file):
        return "force plate (Qualisys), read with its markers", ()
    if capture:
        what = "markers and force plates (C3D)" if suffix == ".c3d" else f"markers ({suffix[1:].upper()})"
        return what, (("static", "static trial"), ("trial", "walk or other motion"), unused)
    if has_force_columns(file):
        of_static = " of a static trial, by its name: not needed (only its markers are used)"
        what = f"forces{of_static if STATIC_NAME.search(file.stem) else ''}"
        return what, (*((f"forces:{forces.name}", f"forces of {forces.name}") for forces in captures), unused)
    if holds_loads(file):
        named = ((f"loads:{forces.name}", f"external loads of {forces.name}") for forces in captures)
        return "meaning of the force columns (ExternalLoads)", (*named, unused)
    if suffix == ".osim":
        return "OpenSim model", (("osim", "model, in place of a static trial"), unused)
    if suffix == ".toml" and "landmarks" in _toml(file):
        return "marker set", (("markers", "marker set"), unused)
    if suffix == ".csv" and "information" in _first_line(file):
        return "body segment parameters of an earlier fit", (("bsp", "prior of the estimate"), unused)
    if is_measures_sheet(file):
        return "girths and lengths of the person", (("measures", "body measurements"), unused)
    if suffix == NEXUS_MEASURES:
        return "measures of the person (Nexus), read where no entry has them", ()
    if suffix in (".toml", ".csv"):
        return "used only where the text of the subject file names it", ()
    return "nothing that Kinertia reads", ()


def uses_of(content: Content) -> dict[str, str]:
    """Return the use by file name."""
    uses: dict[str, str] = {}
    for name, keys in (("model", _MODEL_FILES), ("prior", _PRIOR_FILES)):
        table = _table(content, name)
        uses |= {table[key]: key for key in keys if isinstance(table.get(key), str)}
    for trial in _trials(content):
        markers = str(trial.get("markers", ""))
        uses[markers] = "trial"
        uses |= {str(trial[key]): f"{key}:{markers}" for key in ("forces", "loads") if key in trial}
    return uses


def with_uses(content: Content, uses: Mapping[str, str]) -> Content:
    """Return the entries with these uses of files; other entries of a trial stay with it.

    A model takes the place of the static trial and its marker set.

    Raises:
        SettingsError: two files have a use that only one can have.
    """
    by_use: dict[str, list[str]] = {}
    for name, use in uses.items():
        by_use.setdefault(use, []).append(name)
    for use, names in by_use.items():
        if len(names) > 1 and use not in ("trial", NOT_USED):
            what, _, trial_name = use.partition(":")
            whose = f" of {trial_name}" if trial_name else ""
            raise SettingsError(f"{' and '.join(names)} are both used as {what}{whose}; choose one of them")
    model = {key: value for key, value in _table(content, "model").items() if key not in ("static", "osim")}
    if model.get("markers") not in preset_names():
        model.pop("markers", None)
    model |= {key: chosen[0] for key in _MODEL_FILES if (chosen := by_use.get(key))}
    if "osim" in model:
        model = {key: value for key, value in model.items() if key not in ("static", "markers", "length_unit")}
    else:
        model.pop("calibrate", None)
    known = {str(trial.get("markers")): trial for trial in _trials(content)}
    trials = []
    for markers in sorted(by_use.get("trial", ()), key=lambda name: [*known, name].index(name)):
        trial = {"markers": markers, **known.get(markers, {})}
        for key in ("forces", "loads"):
            trial.pop(key, None)
            if chosen := by_use.get(f"{key}:{markers}"):
                trial[key] = chosen[0]
        trials.append(trial)
    changed = {**content, "model": model, "trial": trials}
    if not trials:
        del changed["trial"]
    prior = {key: value for key, value in _table(content, "prior").items() if key not in _PRIOR_FILES}
    prior |= {key: chosen[0] for key in _PRIOR_FILES if (chosen := by_use.get(key))}
    return {**changed, "prior": prior} if prior else {key: changed[key] for key in changed if key != "prior"}


def put_aside(before: Content, after: Content, aside: Iterable[Content]) -> list[Content]:
    """Collect entries of unused trials, to remember them: those that `before` or `aside` has and `after` lacks."""
    known = {str(trial.get("markers")): dict(trial) for trial in (*aside, *_trials(before))}
    used = {str(trial.get("markers")) for trial in _trials(after)}
    return [trial for markers, trial in known.items() if markers not in used]


def taken_up(content: Content, uses: Mapping[str, str], aside: Iterable[Content]) -> tuple[Content, dict[str, str]]:
    """Restore entries and uses of trials that are used again from those put aside; files with another use keep it."""
    used = {str(trial.get("markers")) for trial in _trials(content)}
    back = [trial for trial in aside if uses.get(str(trial.get("markers"))) == "trial" and trial["markers"] not in used]
    given = set(uses.values())
    free = {name: use for name, use in uses_of({"trial": back}).items() if use not in given}
    again = {name: free.get(name, use) if use == NOT_USED else use for name, use in uses.items()}
    return ({**content, "trial": [*_trials(content), *back]} if back else content), again


def with_new_files(content: Content, draft: Content, present: Iterable[str], seen: Iterable[str]) -> Content:
    """Update entries after files were added or removed: those of missing files go, new files are used as drafted."""
    here, new = set(present), set(present) - set(seen)
    drafted = uses_of(draft)
    uses = {name: use for name, use in uses_of(content).items() if name in here}
    single = {use for use in uses.values() if use in (*_MODEL_FILES, *_PRIOR_FILES)}
    if single & {"static", "osim"}:
        single |= {"static", "osim"}
    for name, use in drafted.items():
        if name in new and name in here and use not in single:
            uses[name] = use
    return with_uses({**draft, **content}, uses)


def within_folder(content: Content) -> Content:
    """Reduce every file in the entries to its name: all are in the person's folder, none is looked for elsewhere."""
    changed = dict(content)
    for name, table in TABLES.items():
        keys = [key for key, field in table.model_fields.items() if _names_a_file(field.annotation)]
        if isinstance(entries := content.get(name), Mapping):
            changed[name] = _by_names_only(entries, keys)
        elif isinstance(entries, list):
            changed[name] = [_by_names_only(entry, keys) if isinstance(entry, Mapping) else entry for entry in entries]
    return changed


def _by_names_only(entries: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    return {
        key: last_part(value) if key in keys and isinstance(value, str) else value for key, value in entries.items()
    }


def _names_a_file(annotation: object) -> bool:
    return annotation is Path or any(map(_names_a_file, get_args(annotation)))


def is_subject_file(file: Path) -> bool:
    """Return whether a TOML file is a subject file."""
    return file.suffix.lower() == ".toml" and bool({"subject", "trial"} & set(_toml(file)))


def _toml(file: Path) -> Content:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return {}


def _first_line(file: Path) -> str:
    with file.open(encoding="utf-8", errors="replace") as stream:
        return stream.readline(1000)


def _table(content: Content, name: str) -> Mapping[str, Any]:
    value = content.get(name)
    return value if isinstance(value, Mapping) else {}


def _trials(content: Content) -> list[Mapping[str, Any]]:
    value = content.get("trial")
    return [trial for trial in value if isinstance(trial, Mapping)] if isinstance(value, list) else []
