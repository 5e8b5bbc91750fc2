"""Runs `kinertia check`: tabulates recordings, screens persons up to inverse kinematics, or OpenSim models alone."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Self

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.markers.marker_set import MarkerSetMatch, match_labels
from kinertia.diagnostics.model.mass_table import ModelCheck, check_model
from kinertia.diagnostics.plates.ground_contact import PlateCheck, check_plates, coverage_of
from kinertia.diagnostics.registry import MODEL_CHECKS
from kinertia.diagnostics.runner import asked, explained, overruled, rules_of
from kinertia.diagnostics.subject.movements import InformativeMovements, task_of
from kinertia.errors import FileError
from kinertia.findings.finding import Finding
from kinertia.findings.overview import Overview
from kinertia.findings.quantity import Quantity
from kinertia.io.file_names import matched_by_name
from kinertia.io.recording import FORCE_FILES, MARKER_FILES, expect_recording, read_recording
from kinertia.io.subject.draft import STATIC_NAME
from kinertia.io.text.qualisys import is_plate_file
from kinertia.model.imported_model import OsimModel
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Overrule, Subject
from kinertia.trial.data import Recording
from kinertia.trial.marker_quality import Travel, Visibility, travel, visibility
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.person import Person, Unread
from kinertia.workflow.screening import Screened, screen


@dataclass(frozen=True, eq=False)
class RecordingCheck:
    """Facts and findings of one recording; times in s on its own time base.

    Attributes:
        context: the context in which the questions were asked.
        marker_set: how the labels fit.
        markers: visibility over the whole recording of the set's markers, or of all where no set fits.
        movements: how far trunk and pelvis move, or None.
        plates: one entry per plate; empty without forces.
        windows: windows in which every foot on the ground stands on a plate, longest first.
        findings: findings of this recording, with what explains and what overrules them.

    Examples:
        >>> check = kinertia.check_recording(kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot"))
        >>> check.travel.kind, len(check.plates), len(check.windows)
        ('walks', 2, 1)
    """

    context: RecordingContext
    marker_set: MarkerSetMatch
    markers: tuple[Visibility, ...]
    movements: InformativeMovements | None
    plates: tuple[PlateCheck, ...]
    windows: tuple[tuple[float, float], ...]
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, context: RecordingContext, findings: Sequence[Finding]) -> Self:
        """Collect facts and findings of a screened recording; `findings` are the whole person's."""
        recording, used = context.recording, context.marker_set
        trial = context.trial
        movements = None
        if used is not None:
            pelvis, torso = (used.segments.get(name, ()) for name in ("pelvis", "torso"))
            movements = InformativeMovements.of(recording.markers, pelvis, torso)
        return cls(
            context,
            match_labels(recording.markers.labels, used)[0],
            visibility(context.markers),
            movements,
            check_plates(recording, context.feet),
            () if trial is None else tuple(trial.windows()),
            tuple(finding for finding in findings if finding.where.trial == context.name),
        )

    @property
    def recording(self) -> Recording:
        """The recording as read."""
        return self.context.recording

    @property
    def used_set(self) -> MarkerSet | None:
        """The marker set that fits, or None."""
        return self.context.marker_set

    @property
    def travel(self) -> Travel:
        """Movement of the person: walking, standing still, or moving on the spot."""
        return self.context.travel

    def facts(self) -> list[tuple[str, str]]:
        """Describe what was measured and how, as pairs of a name and a sentence."""
        markers, plates, match = self.recording.markers, self.recording.plates, self.marker_set
        rate = "" if len(markers.time) < 2 else f" at {markers.rate_hz:g} Hz, {markers.time[0]:.3f} to "
        axes = f"lengths in {self.recording.length_unit}, {self.recording.vertical} up; read as m, Y up"
        had = match.n_labels - len(match.missing)
        named = f"{match.name}{'' if match.fits else ' (the nearest preset)'}: {had} of its {match.n_labels} labels"
        missing = [label + (f" ({' or '.join(near)}?)" if near else "") for label, near in match.missing.items()]
        facts = [
            ("frames", f"{len(markers.time)}{rate}{markers.time[-1]:.3f} s" if rate else "1"),
            ("in the file", axes),
            ("the person", self.travel.sentence()),
            *([] if self.context.is_static else [("task", task_of(self.context))]),
            ("labels", f"{len(markers.labels)}, {len(match.others)} not in the marker set"),
            ("marker set", named if had else "none known"),
        ]
        if self.movements is not None and not self.context.is_static:
            facts.append(("movement", self.movements.sentence()))
        if missing and had:
            facts.append(("missing labels", ", ".join(missing)))
        if plates is None:
            return [*facts, ("forces", "none")]
        rate_hz = (len(plates.time) - 1) / (plates.time[-1] - plates.time[0])
        legs = coverage_of(self.context)
        spans = [f"{start:.3f} to {end:.3f} s" for start, end in sorted(self.windows)]
        return [
            *facts,
            ("forces", f"{len(plates.names)} plates at {rate_hz:.6g} Hz"),
            ("complete contact", ", ".join(spans) or "nowhere, or unknown"),
            *([("joint moments", "; ".join(leg.sentence for leg in legs))] if legs else []),
        ]


@dataclass(frozen=True, eq=False)
class PersonCheck:
    """Recordings of a person, with everything that was found in them.

    Attributes:
        screened: the person with all findings.
        recordings: contents of each recording, the static trial first.

    Examples:
        >>> check = kinertia.check_person(kinertia.read_person(kinertia.read_subject("lab/subject.toml")))
        >>> check.overview.verdict, [one.context.name for one in check.recordings]
        ('use', ['static', 'walk'])
    """

    screened: Screened
    recordings: tuple[RecordingCheck, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings."""
        return self.screened.findings

    @property
    def overview(self) -> Overview:
        """Summary of the findings."""
        trials = len(self.screened.person.trials) + len(
            {finding.where.trial for finding in self.screened.person.unread if finding.where.trial}
        )
        left_out = self.screened.left_out
        asked = [trial for trial in self.screened.context.trials if trial.without_forces and trial.name not in left_out]
        return Overview(self.findings, self.screened.rules, trials - len(asked), left_out)


def check_person(person: Person) -> PersonCheck:
    """Screen a person's recordings as a fit does, up to inverse kinematics.

    Args:
        person: the person as read by `read_person` or `read_files`.
    """
    screened = screen(person)
    contexts = (*screened.context.standing, *screened.context.trials)
    return PersonCheck(screened, tuple(RecordingCheck.of(context, screened.findings) for context in contexts))


def check_recording(
    recording: Recording,
    marker_set: MarkerSet | None = None,
    mass_kg: float | None = None,
    window_s: tuple[float, float] | None = None,
    static: Recording | None = None,
    height_m: float | None = None,
    is_static: bool = False,
) -> RecordingCheck:
    """Check one recording as a fit would, up to inverse kinematics.

    Args:
        recording: markers, and forces if any.
        marker_set: the laboratory's, or the markers of an OpenSim model; found among the presets if None.
        mass_kg: stated mass; the file's own if None.
        window_s: the window that the user vouches for.
        static: the static trial that goes with it, if there is one.
        height_m: stature; the file's own if None.
        is_static: whether the recording is the static trial.

    Examples:
        >>> walk = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> check = kinertia.check_recording(walk, mass_kg=72.6)
        >>> check.marker_set.name, [one.code for one in check.findings if one.severity >= kinertia.Severity.WARNING]
        ('Cleveland Clinic', [])
    """
    subject = Subject(name="person", mass_kg=mass_kg, height_m=height_m)
    if is_static:
        person = Person(subject, (), recording, marker_set=marker_set)
    else:
        person = Person(subject, (TrialInput(recording, window_s),), static, marker_set=marker_set, files_only=True)
    return check_person(person).recordings[-1]


@dataclass(frozen=True, eq=False)
class ModelOverview:
    """Contents and findings of an OpenSim model, with the name of its file."""

    name: str
    facts: ModelCheck
    overview: Overview


def check_osim(model: OsimModel, subject: Subject, overrule: Overrule | None = None) -> ModelOverview:
    """Check an OpenSim model by itself.

    Args:
        model: the model as read.
        subject: mass, stature and sex where they are known.
        overrule: what the user overrules.
    """
    found = asked(MODEL_CHECKS, PersonContext(subject, (), model=model))
    findings = overruled(explained(found), overrule or Overrule())
    facts = check_model(model.skeleton, model.bsp, subject.mass_kg, subject.height_m, subject.sex)
    return ModelOverview(model.path.name, facts, Overview(findings, rules_of(*MODEL_CHECKS), 0))


@dataclass(frozen=True)
class RecordingFiles:
    """Files of one recording."""

    markers: Path
    forces: Path | None = None
    loads: Path | None = None


def files_by_name(
    files: Sequence[Path], loads: Path | None = None, forces: Path | None = None, static: Path | None = None
) -> tuple[RecordingFiles, ...]:
    """Group files into recordings of motions, by their names.

    Args:
        files: markers and forces.
        loads: ExternalLoads file for the only recording with forces.
        forces: forces of the only marker file.
        static: the static trial, which is left out unless it is the only file, as poses may be.

    Raises:
        FileError: a file of another kind, forces without markers, or loads and forces that belong to no trial or to
            several.
    """
    files = [path for path in files if path != static] or files
    for path in files:
        if path.is_dir():
            raise _unpaired(path, "is a folder", "Give the files in it, or a subject file (kinertia init drafts one)")
        if path.suffix.lower() not in (*MARKER_FILES, *FORCE_FILES):
            expect_recording(path)
            raise unknown_kind(path)
    marked = [path for path in files if path.suffix.lower() in MARKER_FILES and not is_plate_file(path)]
    beside = [path for path in files if path not in marked]
    pairs = _matched(marked, beside)
    alone = [path for path in beside if path not in pairs.values()]
    if alone:
        goes = "matches none of the marker files by name" if marked else "holds forces only"
        raise _unpaired(alone[0], goes, f"Check it together with its markers ({', '.join(MARKER_FILES)})")
    wanted = [RecordingFiles(path, pairs.get(path)) for path in marked]
    if forces is not None:
        if len(wanted) != 1 or pairs:
            problem = f"are one trial's forces, but {len(files)} files are given"
            raise _unpaired(forces, problem, "Give one file of markers with --forces")
        wanted = [replace(wanted[0], forces=forces)]
    if loads is not None:
        having = [k for k, files_of_trial in enumerate(wanted) if files_of_trial.forces is not None] or list(
            range(len(wanted))
        )
        if len(having) != 1:
            problem = f"explains one trial's forces, but {len(having)} are given"
            raise _unpaired(loads, problem, "Check one trial at a time")
        wanted[having[0]] = replace(wanted[having[0]], loads=loads)
    return tuple(wanted)


def _unpaired(path: Path, problem: str, action: str) -> FileError:
    return FileError.found(path, "F108", problem=Quantity(problem), action=Quantity(action))


def trial_names(wanted: Sequence[RecordingFiles]) -> list[str]:
    """Name recordings by their marker files, with as much of the path as distinguishes them."""
    paths = [files_of_trial.markers for files_of_trial in wanted]
    names = [[path.stem, path.name, str(path)] for path in paths]
    times = [Counter(level) for level in zip(*names, strict=True)]
    return [
        next((name for k, name in enumerate(candidates) if times[k][name] == 1), candidates[-1]) for candidates in names
    ]


def unknown_kind(path: Path) -> FileError:
    """Return the error for a file of a kind that cannot be checked."""
    known = ", ".join(dict.fromkeys((*MARKER_FILES, *FORCE_FILES, ".toml", ".osim")))
    hint = "; give ExternalLoads with --loads" if path.suffix.lower() == ".xml" else ""
    return FileError(path, f"a '{path.suffix}' file cannot be checked; expected {known}{hint}")


def read_files(
    wanted: Sequence[RecordingFiles],
    stated: Person,
    static: Path | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Person:
    """Read a person from files alone: a recording in which the person stands still is the static trial.

    Args:
        wanted: the files of each recording; the static trial may be among them.
        stated: the person without recordings.
        static: the static trial; found by the data if None, unless there is an OpenSim model in its place.
        progress: called with the share of files read.

    Raises:
        KinertiaError: no recording can be read.
    """
    unread = Unread()
    statics: list[Recording] = []
    moving: list[Recording] = []
    if static is not None:
        wanted = [files_of_trial for files_of_trial in wanted if files_of_trial.markers != static] or wanted
        recording = unread.tried(partial(read_recording, static, standing=True), None)
        statics += [] if recording is None else [recording]
    for k, (name, files_of_trial) in enumerate(zip(trial_names(wanted), wanted, strict=True)):
        progress(k / len(wanted))
        recording = unread.tried(
            partial(read_recording, files_of_trial.markers, files_of_trial.forces, files_of_trial.loads), name
        )
        if recording is not None:
            by_data = static is None and stated.model is None
            stands = by_data and travel(recording.markers).kind == "stands still"
            (statics if stands else moving).append(replace(recording, name=name))
    unread.expect_any([*statics, *moving])
    return replace(
        stated,
        trials=[TrialInput(walk) for walk in moving],
        static=statics[0] if len(statics) == 1 else None,
        more_statics=statics if len(statics) > 1 else (),
        unread=tuple(unread.findings),
    )


def _matched(marked: Sequence[Path], forces: Sequence[Path]) -> dict[Path, Path]:
    """Match marker files with their forces; static trials among themselves, unless there are just two files."""
    if len(marked) == len(forces) == 1:
        return matched_by_name(marked, forces)
    pairs: dict[Path, Path] = {}
    for static in (True, False):
        groups = [[p for p in paths if bool(STATIC_NAME.search(p.stem)) == static] for paths in (marked, forces)]
        pairs |= matched_by_name(*groups)
    return pairs
