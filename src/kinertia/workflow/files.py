"""Which files make one recording, and what a person is of whom there are files only: for `kinertia check`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.qualisys import is_plate_file
from kinertia.io.recording import FORCE_FILES, MARKER_FILES, read_recording
from kinertia.io.subject_draft import STATIC_NAME, matched_by_name
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Overrule, Subject
from kinertia.trial.marker_quality import travel
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.person import Person, Unread


@dataclass(frozen=True)
class RecordingFiles:
    """The files of one recording."""

    markers: Path
    forces: Path | None = None
    loads: Path | None = None


def files_by_name(files: Sequence[Path], loads: Path | None = None) -> tuple[RecordingFiles, ...]:
    """Which files make one recording, by their names; `loads` explains the forces of the only one that has any.

    Raises:
        FileError: a file of another kind, forces without markers, or loads that explain no trial or several.
    """
    for path in files:
        if path.is_dir():
            raise _unpaired(path, "is a folder", "Give the files in it, or a subject file (kinertia init drafts one)")
        if path.suffix.lower() not in (*MARKER_FILES, *FORCE_FILES):
            raise unknown_kind(path)
    marked = [path for path in files if path.suffix.lower() in MARKER_FILES and not is_plate_file(path)]
    forces = [path for path in files if path not in marked]
    pairs = _matched(marked, forces)
    alone = [path for path in forces if path not in pairs.values()]
    if alone:
        goes = "goes with none of the marker files by its name" if marked else "holds forces only"
        raise _unpaired(alone[0], goes, f"Check it together with its markers ({', '.join(MARKER_FILES)})")
    wanted = [RecordingFiles(path, pairs.get(path)) for path in marked]
    if loads is not None:
        having = [k for k, one in enumerate(wanted) if one.forces is not None] or list(range(len(wanted)))
        if len(having) != 1:
            problem = f"explains one trial's forces, but {len(having)} are given"
            raise _unpaired(loads, problem, "Check one trial at a time")
        wanted[having[0]] = replace(wanted[having[0]], loads=loads)
    return tuple(wanted)


def _unpaired(path: Path, problem: str, action: str) -> FileError:
    return FileError.found(path, "F108", problem=Quantity(problem), action=Quantity(action))


def trial_names(wanted: Sequence[RecordingFiles]) -> list[str]:
    """What the recordings are called: as their marker files, with as much of the path as tells them apart."""
    paths = [one.markers for one in wanted]
    names = [[path.stem, path.name, str(path)] for path in paths]
    times = [Counter(level) for level in zip(*names, strict=True)]
    return [next((name for k, name in enumerate(each) if times[k][name] == 1), each[-1]) for each in names]


def unknown_kind(path: Path) -> FileError:
    """The error of a file that is none of those that can be checked."""
    known = ", ".join(dict.fromkeys((*MARKER_FILES, *FORCE_FILES, ".toml", ".osim")))
    hint = "; give ExternalLoads with --loads" if path.suffix.lower() == ".xml" else ""
    return FileError(path, f"a '{path.suffix}' file cannot be checked; expected {known}{hint}")


def read_files(
    wanted: Sequence[RecordingFiles],
    subject: Subject,
    marker_set: MarkerSet | None = None,
    overrule: Overrule | None = None,
    static: Path | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Person:
    """A person of whom there are files only: a recording in which the person stands still is the static trial.

    Args:
        wanted: the files of each recording.
        subject: what is stated.
        marker_set: the laboratory's; found among the presets if None.
        overrule: what the user overrules.
        static: which file is the static trial; by the data if None.
        progress: called with the share of files that are read.

    Raises:
        KinertiaError: no recording can be read.
    """
    unread, recordings, stands = Unread(), [], []
    for k, (name, one) in enumerate(zip(trial_names(wanted), wanted, strict=True)):
        progress(k / len(wanted))
        recording = unread.tried(partial(read_recording, one.markers, one.forces, one.loads), name)
        if recording is not None:
            recordings.append(replace(recording, name=name))
            stands.append(travel(recording.markers).kind == "stands still" if static is None else one.markers == static)
    unread.expect_any(recordings)
    statics = [one for one, is_static in zip(recordings, stands, strict=True) if is_static]
    moving = [one for one, is_static in zip(recordings, stands, strict=True) if not is_static]
    return Person(
        subject=subject,
        trials=[TrialInput(one) for one in moving],
        static=statics[0] if len(statics) == 1 else None,
        more_statics=statics if len(statics) > 1 else (),
        marker_set=marker_set,
        overrule=overrule or Overrule(),
        unread=tuple(unread.findings),
    )


def _matched(marked: Sequence[Path], forces: Sequence[Path]) -> dict[Path, Path]:
    """Marker files with their forces; those of static trials among themselves, unless there are just two files."""
    if len(marked) == len(forces) == 1:
        return matched_by_name(marked, forces)
    pairs: dict[Path, Path] = {}
    for static in (True, False):
        groups = [[p for p in paths if bool(STATIC_NAME.search(p.stem)) == static] for paths in (marked, forces)]
        pairs |= matched_by_name(*groups)
    return pairs
