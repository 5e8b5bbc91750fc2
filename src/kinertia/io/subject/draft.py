"""Drafts a first subject file from the recordings in a folder: `kinertia init`."""

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from kinertia.errors import FileError, KinertiaError, MarkerSetError, missing_file
from kinertia.findings.quantity import Quantity
from kinertia.io.c3d.file_contents import SubjectData, nexus_measures
from kinertia.io.file_names import NEXUS_MEASURES, RESULT_FILES, matched_by_name
from kinertia.io.marker_set_draft import MarkerSetDraft, draft_marker_set, preset_of
from kinertia.io.marker_set_file import marker_set_of, preset_name
from kinertia.io.recording import ADDED_FILES, CORTEX, MARKER_FILES, read_recording
from kinertia.io.subject.body_files import is_measures_sheet
from kinertia.io.subject.tables import Model, PriorFiles, TrialFiles, entry_line
from kinertia.io.text.qualisys import plates_beside
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Settings, Subject, Table
from kinertia.trial.data import Recording
from kinertia.trial.marker_quality import STILL_M_S, speed_m_s

FILL_IN = "  # FILL IN: "
"""Prefix of the description of an entry that stays unknown."""
STATIC_NAME = re.compile(r"static|(?<![a-z])cal(ib\w*)?(?![a-z])", re.IGNORECASE)
"""Pattern in the names of static trials."""
_FORCE_NAME = re.compile("force|grf", re.IGNORECASE)
_FORCES = re.compile(r"<force_identifier>\s*(\S+?)\s*</force_identifier>")
_LISTED = 6
SUBJECT, MARKER_SET = "subject.toml", "markers.toml"
_NO_STATIC = "; none was found: without one, joint centres come from a walk, less exactly"
NOT_USED = "NOT USED: "
"""Before the reason why a drafted marker set is not used."""
NO_FORCES = "# No forces were found for"
"""Beginning of the line about a trial without forces."""


def init_subject(folder: str | Path, nearby: bool = True) -> str:
    """Draft the subject file of `init_files`, without a marker set beside it."""
    return init_files(folder, nearby, marker_set=False)[SUBJECT]


def init_files(
    folder: str | Path,
    nearby: bool = True,
    marker_set: bool = True,
    stated: Mapping[str, object] = MappingProxyType({}),
    conditions: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, str]:
    """Draft a subject file for the recordings in a folder (not its subfolders), and a marker set where none fits the
    static trial; writes nothing.

    The static trial is identified by its name ("static", "cal"), else it is the shortest recording without movement.
    Forces and loads belong to the trial with the most similar name; if the folder has none and `nearby` is True,
    folders in it and beside it are searched. Mass and height come from a C3D file that states them, else from Nexus'
    measures (.mp), as do joint widths. The only OpenSim model of a folder replaces a static trial that no name
    identifies; other models are commented lines. A sheet of girths and lengths is used, but not with a model, whose
    segments are defined differently; of several sheets one must be chosen. Unknown entries, and trials without forces,
    are commented lines marked FILL IN. Recordings whose names begin like another static trial's are left out and listed
    in a comment.

    Args:
        folder: the folder.
        nearby: whether forces are looked for in folders in it and beside it, too.
        marker_set: whether a marker set is drafted where no preset fits.
        stated: entries of `[subject]` that the user gives; they precede those of files.
        conditions: condition of trials by the file's name without its ending.

    Raises:
        FileError: no such folder, or no file of markers in it.
    """
    folder = Path(folder).resolve()
    if not folder.is_dir():
        raise FileError.found(folder, "F101", **missing_file(folder, str(folder), "the folder of the recordings", True))
    files = _expect_files(folder)
    c3d = [file for file in files if file.suffix.lower() == ".c3d"]
    trc = [file for file in files if file.suffix.lower() != ".c3d" and _holds_markers(file)]
    captures = c3d + [file for file in trc if file.stem not in [twin.stem for twin in c3d]]
    models = [file for file in files if file.suffix.lower() == ".osim"]
    by_model = len(models) == 1 and not any(STATIC_NAME.search(file.stem) for file in captures)
    static, trials = (None, captures) if by_model else _static_and_trials(captures)
    others = [file.name for file in c3d + trc if file not in (static, *trials)]
    text = [f"# Drafted from the files in {folder.name}: complete the lines marked FILL IN, check the rest."]
    if others:
        text += [f"# Left out (another subject's, another static trial, or also there as C3D): {', '.join(others)}."]
    nexus = [file for file in files if file.suffix.lower() == NEXUS_MEASURES]
    measured = nexus_measures(nexus[0]) if len(nexus) == 1 else None
    text += ["", "[subject]", *_subject_lines([file for file in (static, *trials) if file in c3d], measured, stated)]
    wanted = marker_set and not by_model and not (folder / MARKER_SET).exists()
    preset, draft = _marker_set(static, trials) if wanted else ("", None)
    text += ["", "[model]"]
    if by_model:
        text += [_entry(Model, "osim", models[0].name)]
    else:
        text += [_static_line(static), _markers_line((folder / MARKER_SET).is_file(), preset, draft)]
    if not by_model:
        offered = models or (_models_near(folder) if nearby else [])
        text += [f"# {_entry(Model, 'osim', _relative(model, folder))}" for model in offered]
    text += _trial_lines(folder, files, trials, nearby, conditions)
    sheets = [] if by_model else [file.name for file in files if is_measures_sheet(file)]
    if sheets:
        text += ["", "[prior]", _entry(PriorFiles, "measures", sheets[0] if len(sheets) == 1 else None, sheets[0])]
    stated = Settings().model_dump(exclude_none=True)
    text += ["", "[settings]", *(_entry(Settings, *item) for item in stated.items())]
    text += [
        "# " + _entry(Settings, key, example) for key, example in (("joint_axes", True), ("convention", "clinical"))
    ]
    text += [""]
    return {SUBJECT: "\n".join(text)} | ({} if draft is None else {MARKER_SET: draft.text})


def _static_line(static: Path | None) -> str:
    """Return the entry of the static trial."""
    guessed = static is not None and not STATIC_NAME.search(static.stem)
    note = " (the shortest in which nobody moves)" if guessed else "" if static else _NO_STATIC
    return _entry(Model, "static", static and static.name, "static.trc", note)


def _markers_line(is_here: bool, preset: str, draft: MarkerSetDraft | None) -> str:
    """Return the entry of a marker set in the folder; in a comment for a preset, which is found without it, and for a
    draft that cannot be right.
    """
    if is_here or (draft is not None and not draft.against):
        return _entry(Model, "markers", MARKER_SET)
    if draft is None:
        return "# " + _entry(Model, "markers", preset or MARKER_SET, note=" (this one)" if preset else "")
    return f"# {_entry(Model, 'markers', MARKER_SET)}; {NOT_USED}{'; '.join(draft.against)}. Correct it first"


def _trial_lines(
    folder: Path, files: Sequence[Path], trials: Sequence[Path], nearby: bool, conditions: Mapping[str, str]
) -> list[str]:
    """Return a table per trial with its condition, and the forces and loads of the most similar names."""
    alone = [trial for trial in trials if not _brings_forces(trial)]
    forces, loads = (
        _here_or_near(folder, files, holds) if nearby else [file for file in files if holds(file)]
        for holds in (holds_forces, holds_loads)
    )
    chosen = matched_by_name(alone, forces)
    text = []
    for trial in trials:
        text += ["", "[[trial]]", _entry(TrialFiles, "markers", trial.name)]
        if condition := conditions.get(trial.stem):
            text.append(_entry(TrialFiles, "condition", condition))
        if trial in chosen:
            text += [_entry(TrialFiles, "forces", _relative(chosen[trial], folder), note=" (matched by name)")]
            for file in matched_by_name([chosen[trial]], loads).values():
                text += [_entry(TrialFiles, "loads", _relative(file, folder), note=" (matched by name)")]
        elif trial in alone:
            text += [f"{NO_FORCES} {trial.name}, here or in the folders in and beside this one.{_unread(files)}"]
            text += [_entry(TrialFiles, "forces", None, "walk_grf.mot")]
    return text or ["", "[[trial]]", _entry(TrialFiles, "markers", None, "walk.trc")]


def _marker_set(static: Path | None, trials: Sequence[Path]) -> tuple[str, MarkerSetDraft | None]:
    """Return the preset that fits the static trial, or else a walk, or a draft where none does; neither where nothing
    can be read.
    """
    file = static or next(iter(trials), None)
    recording = _recording(file, standing=static is not None) if file else None
    if file is None or recording is None:
        return "", None
    recording = recording.without_empty_markers()
    fits = preset_of(recording) if static else _known(recording)
    if fits is None:
        return "", draft_marker_set(recording, file.parent.name)
    return preset_name(fits), None


def _known(walk: Recording) -> MarkerSet | None:
    try:
        return marker_set_of(walk.markers)
    except MarkerSetError:
        return None


def _expect_files(folder: Path) -> list[Path]:
    """List the files in the folder, recordings among them.

    Raises:
        FileError: there are none, or a name that no subject file can hold.
    """
    files = sorted(path for path in folder.iterdir() if not path.name.startswith("."))  # archives of Macs have twins
    for file in files:
        if not _is_utf8(file.name):
            reason = Quantity("its name is not UTF-8, so a subject file cannot contain it")
            raise FileError.found(file, "F192", name=Quantity(ascii(file.name)), problem=reason)
    if not any(map(is_capture, files)):
        problem = f"holds no file of markers ({', '.join(MARKER_FILES)})"
        inside = [entry for file in files for entry in (file, *_entries(file)) if any(map(is_capture, _entries(entry)))]
        if len(inside) == 1:
            problem += f", but its folder {_relative(inside[0], folder)} does; give that one"
        elif inside:
            listed = ", ".join(_relative(capture, folder) for capture in inside[:_LISTED]) + (
                ", ..." * (len(inside) > _LISTED)
            )
            problem += f", but its folders {listed} do; give one person's folder, with the static trial"
        action = Quantity("Give a folder with the recordings of one person")
        raise FileError.found(folder, "F108", problem=Quantity(problem), action=action)
    return files


def _entry(table: type[Table], key: str, value: object, example: object = None, note: str = "") -> str:
    """Return `key = value  # description`; without a value a commented example to fill in."""
    if value is None:
        return f"# {key} = {json.dumps(example)}{FILL_IN}{table.model_fields[key].description}{note}"
    return entry_line(table, key, value, note)


def _subject_lines(c3d: Sequence[Path], measured: SubjectData | None, stated: Mapping[str, object]) -> list[str]:
    recordings = [recording for recording in map(_recording, c3d) if recording]
    lines = [_entry(Subject, "sex", stated.get("sex"), "female")]
    for key, example in (("mass_kg", 70.0), ("height_m", 1.7)):
        filed = next((getattr(recording, key) for recording in recordings if getattr(recording, key)), None)
        source = "C3D" if filed else NEXUS_MEASURES
        filed = filed or getattr(measured, key, None)
        value = filed and float(f"{filed:.6g}")  # 32.1, not the 32.099998 of a C3D's single precision
        from_file = bool(value) and key not in stated
        lines.append(_entry(Subject, key, stated.get(key, value), example, f" (from {source})" if from_file else ""))
    known = {key for recording in recordings for key in recording.measurements}
    lengths_m = {} if measured is None else measured.measurements
    for joint in ("Knee", "Ankle", "Elbow"):
        if widths := [
            lengths_m[key] for key in (f"R{joint}Width", f"L{joint}Width") if key in lengths_m.keys() - known
        ]:
            width_mm = round(1e3 * sum(widths) / len(widths), 1)
            lines.append(_entry(Subject, f"{joint.lower()}_width_mm", width_mm, note=f" (from {NEXUS_MEASURES})"))
    age = entry_line(Subject, "age_years", stated.get("age_years", 30))
    return [*lines, age if "age_years" in stated else f"# {age}"]


def _static_and_trials(captures: Sequence[Path]) -> tuple[Path | None, list[Path]]:
    """Separate the static trial from the dynamic trials that share most of the beginning of its name."""
    statics = [file for file in captures if STATIC_NAME.search(file.stem)]
    if not statics and len(captures) > 1:
        speeds = {file: (_speed_m_s(file), _duration_s(file)) for file in captures}
        still = [file for file in captures if speeds[file][0] < STILL_M_S]
        statics = [min(still, key=lambda file: speeds[file][1])] if still else []
    dynamic = [file for file in captures if file not in statics]
    if not statics or not dynamic:
        return (statics[0] if statics else None), dynamic
    # of equals `max` takes the first, so that unrelated names all go to the first static trial
    owners = [max(statics, key=lambda s: _common_start(s.stem, file.stem)) for file in dynamic]
    return owners[0], [file for file, owner in zip(dynamic, owners, strict=True) if owner == owners[0]]


def _is_utf8(name: str) -> bool:
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _common_start(a: str, b: str) -> int:
    return next((k for k, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))


def _recording(file: Path, standing: bool = False) -> Any:
    """Read a capture, or return None where it cannot be read: reading the trial itself will report why."""
    try:
        return read_recording(file, standing=standing)
    except KinertiaError:
        return None


def _duration_s(file: Path) -> float:
    recording = _recording(file)
    return recording.markers.time[-1] - recording.markers.time[0] if recording else float("inf")


def _speed_m_s(file: Path) -> float:
    recording = _recording(file)
    return float("inf") if recording is None else speed_m_s(recording.markers)


def _head(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            return stream.read(20_000).decode("utf-8", errors="replace")
    except FileNotFoundError:  # a link to what is not there
        return ""


def is_capture(file: Path) -> bool:
    """Return whether a file is a recording of markers, by its extension and, where that is ambiguous, its head."""
    return file.suffix.lower() == ".c3d" or _holds_markers(file)


def _holds_markers(file: Path) -> bool:
    """Return whether a text file is a recording of markers, by its extension and its head."""
    marks = {".tsv": "MARKER_NAMES", ".csv": "Sub Frame"}
    kind = file.suffix.lower()
    return kind in (".trc", *ADDED_FILES) or (kind in marks and marks[kind] in _head(file))


def _brings_forces(file: Path) -> bool:
    """Return whether force plates come with the recording."""
    kind = file.suffix.lower()
    return kind == ".c3d" or (kind == ".tsv" and bool(plates_beside(file))) or (kind == ".csv" and _has_plates(file))


def _has_plates(file: Path) -> bool:
    recording = _recording(file)
    return recording is not None and recording.plates is not None


def _here_or_near(folder: Path, files: Sequence[Path], holds: Callable[[Path], bool]) -> list[Path]:
    """Return the files of the folder that `holds` accepts; else those of folders in it and beside it, else those of
    folders of forces beside its parent (OpenCap's `MarkerData/Mocap` and `ForceData`). Folders with markers of their
    own, which may be another person's, and results of Kinertia are left out.
    """
    holding = [file for file in files if holds(file)]
    of_forces = [entry for entry in _entries(folder.parent.parent) if _FORCE_NAME.search(entry.name)]
    for near in ([*files, *_entries(folder.parent)], of_forces):
        for other in near if not holding else ():
            inside = [file for file in _entries(other) if file.is_file()]
            results = RESULT_FILES[0] in (file.name for file in inside)
            if other != folder and not results and not any(map(is_capture, inside)):
                holding += [file for file in inside if holds(file)]
    return holding


def _models_near(folder: Path) -> list[Path]:
    """Return OpenSim models of the folders beside this one, where AddBiomechanics and OpenCap put them."""
    beside = _entries(folder.parent)
    places = [*beside, *(inner for entry in beside if entry.name == "OpenSimData" for inner in _entries(entry))]
    return [
        file
        for place in places
        if place.name.lower().startswith("model")
        for file in _entries(place)
        if file.suffix == ".osim"
    ]


def _entries(folder: Path) -> list[Path]:
    """List the folder's content; nothing where it is a file or belongs to another user."""
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _relative(file: Path, folder: Path) -> str:
    """Return the path as a subject file in the folder states it."""
    return Path(os.path.relpath(file, folder)).as_posix()


def holds_loads(file: Path) -> bool:
    """Return whether a file is ExternalLoads."""
    return file.suffix.lower() == ".xml" and "<ExternalLoads" in _head(file)


def holds_forces(file: Path) -> bool:
    """Return whether a motion file has force columns and is not the static trial's."""
    return not STATIC_NAME.search(file.stem) and has_force_columns(file)


def has_force_columns(file: Path) -> bool:
    """Return whether a motion file, of any trial, has columns `..._vx`, `..._vy`, ..., or columns that the
    ExternalLoads beside it assign to forces.
    """
    if file.suffix.lower() == CORTEX:
        return True
    if file.suffix.lower() not in (".mot", ".sto"):
        return False
    columns = _head(file)
    if re.search(r"_v[xyz]\b", columns):
        return True
    named = [name for other in _entries(file.parent) if holds_loads(other) for name in _FORCES.findall(_head(other))]
    return any(re.search(rf"(?<!\S){re.escape(name)}x(?!\S)", columns) for name in named)


def _unread(files: Sequence[Path]) -> str:
    """Advise on files that are called forces and have no known columns."""
    named = [file for file in files if file.suffix.lower() in (".mot", ".sto") and _FORCE_NAME.search(file.stem)]
    unread = [file.name for file in named if not has_force_columns(file)]
    if not unread:
        return ""
    return (
        f" {', '.join(unread)}: no columns like ground_force_vx; rename them, or put the ExternalLoads file (.xml) "
        "beside it that says which column is what."
    )
