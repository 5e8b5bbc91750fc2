"""What `kinertia check` looks at together: the recordings of a person, by their files or by a subject file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from kinertia.diagnostics.labels.marker_set_match import common_marker_set
from kinertia.diagnostics.model.model_check import ModelCheck, check_model_of_subject
from kinertia.diagnostics.result.verdict import Verdict
from kinertia.diagnostics.subject.camera_scale import trial_scales
from kinertia.diagnostics.timing.trial_delays import trial_delays_doubts
from kinertia.errors import FileError, KinertiaError
from kinertia.io.belt_file import read_belt
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.osim.reader import read_osim
from kinertia.io.qualisys import is_plate_file
from kinertia.io.recording import FORCE_FILES, MARKER_FILES, read_recording
from kinertia.io.subject_draft import STATIC_NAME, matched_by_name
from kinertia.io.subject_file import SubjectFile
from kinertia.model.marker_set import MarkerSet
from kinertia.model.model_markers import markers_of_model
from kinertia.settings import Subject
from kinertia.trial.data import Recording
from kinertia.trial.marker_quality import travel
from kinertia.workflow.joint_widths import with_widths
from kinertia.workflow.recording import RecordingCheck, check_recording


@dataclass(frozen=True)
class RecordingFiles:
    """The files of one recording, the window that the user vouches for, and what the trial is called."""

    markers: Path
    forces: Path | None = None
    loads: Path | None = None
    window_s: tuple[float, float] | None = None
    length_unit: str | None = None
    belt_speed_m_s: float | tuple[float, float] | Path | None = None
    name: str | None = None

    @property
    def title(self) -> str:
        """Names of the files."""
        return ", ".join(path.name for path in (self.markers, self.forces, self.loads) if path is not None)


@dataclass(frozen=True)
class PersonFiles:
    """What is to be checked of one person.

    Attributes:
        recordings: the static trial, if there is one, and the others.
        marker_set: the laboratory's, or the markers of an OpenSim model; found among the presets if None.
        mass_kg, height_m: of who walked, where they are known.
        static: which of the recordings is the static trial; if None, the only one in which the person stands still.
        subject: who walked, with the widths of joints that were stated.
        models: the OpenSim model by its name, where something speaks against it.
    """

    recordings: tuple[RecordingFiles, ...]
    marker_set: MarkerSet | None = None
    mass_kg: float | None = None
    height_m: float | None = None
    static: RecordingFiles | None = None
    subject: Subject | None = None
    models: tuple[tuple[str, ModelCheck], ...] = ()


def files_of_subject(subject: SubjectFile) -> PersonFiles:
    """What a subject file names."""
    named = subject.model.markers
    trials = [
        RecordingFiles(
            trial.markers,
            trial.forces,
            trial.loads,
            trial.window_s,
            trial.length_unit,
            trial.belt_speed_m_s,
            trial.name,
        )
        for trial in subject.trials
    ]
    marker_set = None if named is None else read_marker_set(named)
    who = subject.subject
    if subject.model.osim is not None:
        model = read_osim(subject.model.osim)
        marker_set = markers_of_model(model)
        doubted = check_model_of_subject(model.skeleton, model.bsp)
        models = () if doubted is None else ((model.path.name, doubted),)
        return PersonFiles(tuple(trials), marker_set, who.mass_kg, who.height_m, subject=who, models=models)
    if subject.model.static is None:
        return PersonFiles(tuple(trials), marker_set, who.mass_kg, who.height_m, subject=who)
    static = RecordingFiles(subject.model.static, length_unit=subject.model.length_unit)
    return PersonFiles((static, *trials), marker_set, who.mass_kg, who.height_m, static, who)


def files_by_name(files: Sequence[Path], loads: Path | None = None) -> tuple[RecordingFiles, ...]:
    """Which files make one recording, by their names; `loads` explains the forces of the only one that has any.

    Raises:
        FileError: a file of another kind, forces without markers, or loads that explain no trial or several.
    """
    for path in files:
        if path.is_dir():
            raise FileError(path, "is a folder; give the files in it, or its subject file (kinertia init drafts one)")
        if path.suffix.lower() not in (*MARKER_FILES, *FORCE_FILES):
            raise unknown_kind(path)
    marked = [path for path in files if path.suffix.lower() in MARKER_FILES and not is_plate_file(path)]
    forces = [path for path in files if path not in marked]
    pairs = _matched(marked, forces)
    alone = [path for path in forces if path not in pairs.values()]
    if alone:
        goes = "goes with none of the marker files by its name" if marked else "holds forces only"
        raise FileError(alone[0], f"{goes}; check it together with its markers ({', '.join(MARKER_FILES)})")
    wanted = [RecordingFiles(path, pairs.get(path)) for path in marked]
    if loads is not None:
        having = [k for k, one in enumerate(wanted) if one.forces is not None] or list(range(len(wanted)))
        if len(having) != 1:
            raise FileError(
                loads, f"explains one trial's forces, but {len(having)} are given; check one trial at a time"
            )
        wanted[having[0]] = replace(wanted[having[0]], loads=loads)
    return tuple(wanted)


def unknown_kind(path: Path) -> FileError:
    """The error of a file that is none of those that can be checked."""
    known = ", ".join(dict.fromkeys((*MARKER_FILES, *FORCE_FILES, ".toml", ".osim")))
    hint = "; give ExternalLoads with --loads" if path.suffix.lower() == ".xml" else ""
    return FileError(path, f"a '{path.suffix}' file cannot be checked; expected {known}{hint}")


def check_files(
    wanted: PersonFiles, progress: Callable[[float], None] = lambda share: None
) -> tuple[list[tuple[str, RecordingCheck]], list[str]]:
    """Findings by title, and a sentence for each recording that cannot be read."""
    recordings, mistakes = _read(wanted.recordings, progress)
    marker_set = wanted.marker_set
    if marker_set is None:
        marker_set = common_marker_set([recording for _, recording in recordings])
    mass_kg, height_m = (
        getattr(wanted, quantity) or _common([getattr(recording, quantity) for _, recording in recordings])
        for quantity in ("mass_kg", "height_m")
    )
    statics = [r for one, r in recordings if one is wanted.static] or [
        r for _, r in recordings if travel(r.markers).kind == "stands still"
    ]
    checks = []
    for one, recording in recordings:
        static = statics[0] if len(statics) == 1 and recording is not statics[0] else None
        own_set, is_static = marker_set, one is wanted.static
        if marker_set is not None and any(recording is each for each in statics):
            others = [other for _, other in recordings if other is not recording]
            recording, own_set, _ = with_widths(recording, others, marker_set, wanted.subject or Subject(name="person"))
        judged = check_recording(recording, own_set, mass_kg, one.window_s, static, height_m, is_static)
        checks.append((one.title, judged))
    doubts = trial_delays_doubts([one.delay for _, one in checks])
    if marker_set is not None:
        moving = [recording for _, recording in recordings if all(recording is not each for each in statics)]
        doubts += trial_scales([(one.name, one.markers) for one in moving], marker_set)
    return _with_doubts(checks, doubts), mistakes


def _with_doubts(
    checks: Sequence[tuple[str, RecordingCheck]], doubts: Sequence[tuple[str, str]]
) -> list[tuple[str, RecordingCheck]]:
    """Findings by title, with what trials say of one another: name and sentence."""
    told = {
        name: tuple(Verdict("caution", sentence) for each, sentence in doubts if each == name) for name, _ in doubts
    }
    return [(title, replace(one, verdicts=(*one.verdicts, *told.get(one.recording.name, ())))) for title, one in checks]


def _common(stated: Sequence[float | None]) -> float | None:
    """What all files of a person say that say anything."""
    values = {value for value in stated if value is not None}
    return values.pop() if len(values) == 1 else None


def _matched(marked: Sequence[Path], forces: Sequence[Path]) -> dict[Path, Path]:
    """Marker files with their forces; those of static trials among themselves, unless there are just two files."""
    if len(marked) == len(forces) == 1:
        return matched_by_name(marked, forces)
    pairs: dict[Path, Path] = {}
    for static in (True, False):
        groups = [[p for p in paths if bool(STATIC_NAME.search(p.stem)) == static] for paths in (marked, forces)]
        pairs |= matched_by_name(*groups)
    return pairs


def _read(
    wanted: Sequence[RecordingFiles], progress: Callable[[float], None]
) -> tuple[list[tuple[RecordingFiles, Recording]], list[str]]:
    """The recordings, and a sentence for each that cannot be read."""
    recordings, mistakes = [], []
    for k, one in enumerate(wanted):
        progress(k / len(wanted))
        try:
            recording = read_recording(one.markers, one.forces, one.loads, one.length_unit)
            name = one.name or recording.name
            recordings.append((one, replace(recording, name=name, belt=read_belt(one.belt_speed_m_s))))
        except KinertiaError as error:
            mistakes.append(str(error))
    return recordings, mistakes
