"""Is a wrong measurement named? Known mistakes are made in the files of real walks, one at a time.

`kinertia check` looks at the files first; what it does not doubt is fitted, and its joint moments are compared with
those of the sound files. What is said of sound files is counted, too: of the walks as they are, and of other people in
laboratories without mistakes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, NamedTuple

import numpy as np

from kinertia.diagnostics.result.verdict import verdicts
from kinertia.errors import KinertiaError
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.result import Fit
from kinertia.estimation.simultaneous.instruments import FLOOR_PRIOR, PLATE_PRIOR
from kinertia.io.subject_file import SubjectFile, read_subject
from kinertia.studies.parallel import in_parallel
from kinertia.synthetic import load_mistakes as plates
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.measured_person import MeasuredPerson, read_person, write_person
from kinertia.synthetic.mistakes import MISTAKES, Mistake
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.workflow.files import check_files, files_of_subject
from kinertia.workflow.from_files import fit_subject

Outcome = Literal["named", "warned", "harmless", "silent", "not possible"]
"""What became of a mistake: named; warned with another cause; moments within their deviations; neither; there is
nothing to make it with."""
_WALK_S, _PLATE_RATE_HZ, _START, _SAMPLES_PER_FRAME = 2.7, 1000.0, 0.75, 10
_LEGS = re.compile(r"(hip|knee|ankle|subtalar)_")


class Finding(NamedTuple):
    """What was said of files or of their fit: "fail" or "caution", the sentence, and by whom ("check" or "fit")."""

    level: str
    sentence: str
    by: str = "check"


@dataclass(frozen=True, eq=False)
class JointMoments:
    """Moments (n, c) N m of the legs' coordinates over time (n,) s, and their deviations."""

    time: np.ndarray
    coordinates: tuple[str, ...]
    moment_nm: np.ndarray
    sd_nm: np.ndarray


@dataclass(frozen=True, eq=False)
class SoundWalk:
    """A walk as it is: what is said of it, and its joint moments; None where it cannot be fitted."""

    name: str
    subject: SubjectFile
    findings: tuple[Finding, ...]
    moments: JointMoments | None


@dataclass(frozen=True)
class FaultOutcome:
    """What became of one mistake in one walk.

    Attributes:
        walk, mistake: names.
        outcome: see `Outcome`.
        said: the first new sentence; empty where there is none.
        by: who said it: "check" or "fit".
        change_sd, change_nm: change of the joint moments (RMS) over their deviations (RMS), and in N m, of the
        coordinate
            where the former is largest; NaN where no fit was made.
    """

    walk: str
    mistake: str
    outcome: Outcome
    said: str = ""
    by: str = ""
    change_sd: float = np.nan
    change_nm: float = np.nan


def run_faults(
    walks: Mapping[str, SubjectFile],
    mistakes: Sequence[Mistake] = MISTAKES,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[list[SoundWalk], list[FaultOutcome]]:
    """What is said of the walks as they are, and of each with every mistake.

    Args:
        walks: subject files by name; of each the first trial is used.
        mistakes: of `MISTAKES`.
        workers: processes; as many as there are cores if None.
        progress: called with the share that is done.
    """
    sound = run_sound(walks, workers, lambda share: progress(0.1 * share))
    cases = [(one, mistake.name) for one in sound for mistake in mistakes]
    return sound, in_parallel(_spoilt, cases, workers, lambda share: progress(0.1 + 0.9 * share))


def run_sound(
    walks: Mapping[str, SubjectFile],
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[SoundWalk]:
    """What is said of walks as they are; arguments as of `run_faults`."""
    return in_parallel(_sound, list(walks.items()), workers, progress)


def sound_laboratories(folder: Path, count: int) -> dict[str, SubjectFile]:
    """Files of people drawn from the literature's prior, each in a laboratory whose plates and floor are off by no more
    than sound ones are; written into this folder.
    """
    laboratories = {}
    for number in range(1, count + 1):
        rng = np.random.default_rng([19, number])
        subject = walking_subject()
        person = replace(subject, bsp=literature_prior(subject.literature).draw(rng))
        trial = walk(person, _WALK_S, _PLATE_RATE_HZ, _START)
        noise = LabNoise(camera_sd_m=rng.uniform(0.0002, 0.001), force_sd_n=rng.uniform(0.5, 3.0))
        recorded = write_lab(folder / f"{number} lab", record(person, trial, noise, rng, _SAMPLES_PER_FRAME))
        measured = read_person(read_subject(recorded), rng)
        x, z, gain, turn = (
            float(rng.normal(0.0, prior.sound_sd))
            for prior in (FLOOR_PRIOR["x"], FLOOR_PRIOR["z"], PLATE_PRIOR["gain"], FLOOR_PRIOR["turn"])
        )
        for change in (
            plates.moved(x, z),
            plates.scaled(force=1.0 + gain),
            plates.turned_about_vertical(float(np.degrees(turn))),
        ):
            measured = change(measured, rng) or measured
        own = folder / f"{number}"
        own.mkdir()
        laboratories[f"laboratory {number}"] = read_subject(write_person(own, measured))
    return laboratories


def synthetic_walk(folder: Path) -> SubjectFile:
    """Files of the package's own walk, in a careful laboratory, written into this folder."""
    subject = walking_subject()
    trial = walk(subject, _WALK_S, _PLATE_RATE_HZ, _START)
    recordings = record(subject, trial, LabNoise(), np.random.default_rng(1), _SAMPLES_PER_FRAME)
    return read_subject(write_lab(folder, recordings))


def _sound(case: tuple[str, SubjectFile]) -> SoundWalk:
    name, subject = case
    with TemporaryDirectory() as folder:
        path = write_person(Path(folder), _person(subject, name))
        findings, moments = checked(path), None
        try:
            fit = fit_subject(path)
        except KinertiaError as error:
            findings.append(Finding("fail", str(error), "fit"))
        else:
            findings += of_fit(fit)
            moments = moments_of(fit)
    return SoundWalk(name, subject, tuple(findings), moments)


def _spoilt(case: tuple[SoundWalk, str]) -> FaultOutcome:
    sound, name = case
    return outcome_of(sound, next(one for one in MISTAKES if one.name == name))


def outcome_of(sound: SoundWalk, mistake: Mistake) -> FaultOutcome:
    """Make the mistake in the files of the walk, and see what becomes of it."""
    person = mistake.change(_person(sound.subject, sound.name), np.random.default_rng(_seed(mistake.name)))
    if person is None:
        return FaultOutcome(sound.name, mistake.name, "not possible")
    with TemporaryDirectory() as folder:
        path = write_person(Path(folder), person)
        by_check = checked(path)
        judgement = judged(mistake, sound.findings, by_check)
        if judgement is not None:
            return FaultOutcome(sound.name, mistake.name, judgement[0], judgement[1], "check")
        try:
            fit = fit_subject(path)
        except KinertiaError as error:
            judgement = judged(mistake, sound.findings, [Finding("fail", str(error), "fit")])
            outcome, said = judgement or ("warned", str(error))
            return FaultOutcome(sound.name, mistake.name, outcome, said, "fit")
    sd, nm = change(sound.moments, moments_of(fit))
    judgement = judged(mistake, sound.findings, of_fit(fit))
    if judgement is not None:
        return FaultOutcome(sound.name, mistake.name, judgement[0], judgement[1], "fit", sd, nm)
    return FaultOutcome(sound.name, mistake.name, "harmless" if sd <= 1.0 else "silent", "", "", sd, nm)


def _person(subject: SubjectFile, name: str) -> MeasuredPerson:
    return read_person(subject, np.random.default_rng(_seed(name)))


def _seed(name: str) -> list[int]:
    return list(name.encode())


def checked(subject: Path) -> list[Finding]:
    """What `kinertia check` doubts."""
    try:
        checks, unreadable = check_files(files_of_subject(read_subject(subject)))
    except KinertiaError as error:
        return [Finding("fail", str(error))]
    findings = [Finding("fail", sentence) for sentence in unreadable]
    return findings + [Finding(*verdict) for _, one in checks for verdict in one.verdicts if verdict.level != "pass"]


def of_fit(fit: Fit) -> list[Finding]:
    """What `kinertia fit` doubts or has corrected once it has computed."""
    warned = [Finding("caution", sentence, "fit") for sentence in (*fit.warnings, *fit.corrections)]
    return warned + [Finding(*verdict, "fit") for verdict in verdicts(fit) if verdict.level != "pass"]


def judged(
    mistake: Mistake, sound: Sequence[Finding], findings: Sequence[Finding]
) -> tuple[Literal["named", "warned"], str] | None:
    """Whether the first and worst of what is new names the mistake; None where nothing is new.

    New is what is not said of the sound files in the same words, clause by clause, whatever the numbers. Where nothing
    is, other numbers in words that name the mistake do.
    """
    before = {(one.level, clause) for one in sound for clause in _clauses(one.sentence)}
    new = [one for one in findings if any((one.level, clause) not in before for clause in _clauses(one.sentence))]
    worst = [one for one in new if one.level == "fail"] or new
    if worst:
        named = re.search(mistake.named, worst[0].sentence) is not None
        return ("named" if named else "warned"), worst[0].sentence
    again = [one for one in findings if one not in sound and re.search(mistake.named, one.sentence)]
    return ("named", again[0].sentence) if again else None


def _clauses(sentence: str) -> list[str]:
    words = re.sub(r"[-+]?\d[\d.]*", "#", sentence)
    return re.split(r"[,;:] ", words)


def moments_of(fit: Fit) -> JointMoments:
    """Of the legs, of the first trial."""
    trial = fit.trials[0]
    table, deviation = trial.moments["estimate"], trial.moment_sd
    legs = [name for name in table.columns if _LEGS.match(name)]
    sd = np.full((len(table), len(legs)), np.nan) if deviation is None else deviation[legs].to_numpy()
    return JointMoments(trial.time, tuple(legs), table[legs].to_numpy(), sd)


def change(sound: JointMoments | None, other: JointMoments) -> tuple[float, float]:
    """Largest RMS change of a moment over its RMS deviation, and that change in N m, over the time that both have."""
    if sound is None:
        return np.nan, np.nan
    both = (other.time >= sound.time[0] - 1e-9) & (other.time <= sound.time[-1] + 1e-9)
    if not both.any():
        return np.inf, np.nan
    time = other.time[both]
    was, sd = (
        np.column_stack([np.interp(time, sound.time, column) for column in values.T])
        for values in (sound.moment_nm, sound.sd_nm)
    )
    changed = np.sqrt(np.square(other.moment_nm[both] - was).mean(axis=0))
    share = changed / np.sqrt(np.square(sd).mean(axis=0))
    worst = int(np.argmax(share))
    return float(share[worst]), float(changed[worst])
