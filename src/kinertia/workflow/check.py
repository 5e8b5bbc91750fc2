"""Runs `kinertia check`: a person's recordings up to inverse kinematics, or OpenSim models alone."""

from dataclasses import dataclass

from kinertia.diagnostics.model import questions as model_questions
from kinertia.diagnostics.model.model_check import ModelCheck, check_model
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import asked, explained, overruled, rules_of
from kinertia.findings.finding import Finding
from kinertia.findings.overview import Overview
from kinertia.model.imported_model import OsimModel
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Overrule, Subject
from kinertia.trial.data import Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.person import Person
from kinertia.workflow.recording import RecordingCheck
from kinertia.workflow.screening import Screened, screen


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
            {one.where.trial for one in self.screened.person.unread if one.where.trial}
        )
        left_out = self.screened.left_out
        asked = [one for one in self.screened.context.trials if one.without_forces and one.name not in left_out]
        return Overview(self.findings, self.screened.rules, trials - len(asked), left_out)


def check_person(person: Person) -> PersonCheck:
    """Screen a person's recordings as a fit does, up to inverse kinematics.

    Args:
        person: the person as read by `read_person` or `read_files`.
    """
    screened = screen(person)
    contexts = (*screened.context.standing, *screened.context.trials)
    return PersonCheck(screened, tuple(RecordingCheck.of(one, screened.findings) for one in contexts))


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
    found = asked(model_questions.PERSON_QUESTIONS, PersonContext(subject, (), model=model))
    findings = overruled(explained(found), overrule or Overrule())
    facts = check_model(model.skeleton, model.bsp, subject.mass_kg, subject.height_m, subject.sex)
    return ModelOverview(model.path.name, facts, Overview(findings, rules_of(*model_questions.PERSON_QUESTIONS), 0))
