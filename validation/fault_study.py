"""Is a wrong measurement identified? Known faults are made in the files of real walks, one at a time.

`kinertia check` looks at the files first; what it does not identify or block is fitted, and its joint moments are
compared with those of the fault-free files. Findings in fault-free files are counted, too: of the walks as they are,
and of other people in laboratories without faults.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from kinertia.errors import KinertiaError, findings_of
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.instruments.priors import FLOOR_PRIOR, PLATE_PRIOR
from kinertia.findings.finding import Finding
from kinertia.findings.overview import reported
from kinertia.findings.quantity import Quantity
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import SubjectFile
from kinertia.studies.parallel import in_parallel
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.workflow.check import check_person
from kinertia.workflow.from_files import fit_subject
from kinertia.workflow.person import read_person
from validation import load_mistakes as plates
from validation.measured_person import MeasuredPerson, write_person
from validation.measured_person import read_person as read_measured
from validation.mistakes import MISTAKES, Mistake

Outcome = Literal["identified", "warned", "harmless", "unnoticed", "not possible"]
"""Outcome of a fault: identified; other findings are new; moments within their SDs; neither; there is
nothing to make it with."""
_WALK_S, _PLATE_RATE_HZ, _START, _SAMPLES_PER_FRAME = 2.7, 1000.0, 0.75, 10
_CHANGED_SD = 3.0
"""SDs by which the size of a finding must differ from the fault-free files' to count as new."""
_LEGS = re.compile(r"(hip|knee|ankle|subtalar)_")


@dataclass(frozen=True, eq=False)
class JointMoments:
    """Moments (n, c) N m of the legs' coordinates over time (n,) s, and their SDs."""

    time: np.ndarray
    coordinates: tuple[str, ...]
    moment_nm: np.ndarray
    sd_nm: np.ndarray


@dataclass(frozen=True, eq=False)
class SoundWalk:
    """A fault-free walk: its findings by fit and by check, and its joint moments; None where it cannot be fitted."""

    name: str
    subject: SubjectFile
    findings: tuple[Finding, ...]
    checked: tuple[Finding, ...]
    moments: JointMoments | None


@dataclass(frozen=True)
class FaultOutcome:
    """Outcome of one fault in one walk.

    Attributes:
        walk, mistake: names of the walk and the fault.
        outcome: see `Outcome`.
        code: code of the finding that identifies it, else of the worst new one; empty where there is none.
        said: message of the finding.
        by: command that found it: "check" or "fit".
        change_sd, change_nm: change of the joint moments (RMS) over their SDs (RMS), and in N m, of the
            coordinate where the former is largest; NaN where no fit was made.
    """

    walk: str
    mistake: str
    outcome: Outcome
    code: str = ""
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
    """Return the findings in the fault-free walks, and in each walk with every fault.

    Args:
        walks: subject files by name; the first trial of each is used.
        mistakes: faults among `MISTAKES`.
        workers: processes; as many as there are cores if None.
        progress: called with the share done.
    """
    sound = run_sound(walks, workers, lambda share: progress(0.1 * share))
    cases = [(sound_walk, mistake.name) for sound_walk in sound for mistake in mistakes]
    return sound, in_parallel(_spoilt, cases, workers, lambda share: progress(0.1 + 0.9 * share))


def run_sound(
    walks: Mapping[str, SubjectFile],
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[SoundWalk]:
    """Return the findings in the fault-free walks; arguments as in `run_faults`."""
    return in_parallel(_sound, list(walks.items()), workers, progress)


def sound_laboratories(folder: Path, count: int) -> dict[str, SubjectFile]:
    """Write files of people drawn from the literature's prior into this folder, each in a laboratory whose plate errors
    are no larger than fault-free ones.
    """
    laboratories = {}
    for number in range(1, count + 1):
        rng = np.random.default_rng([19, number])
        subject = walking_subject()
        person = replace(subject, bsp=literature_prior(subject.literature).draw(rng))
        trial = walk(person, _WALK_S, _PLATE_RATE_HZ, _START)
        noise = LabNoise(camera_sd_m=rng.uniform(0.0002, 0.001), force_sd_n=rng.uniform(0.5, 3.0))
        recorded = write_lab(folder / f"{number} lab", record(person, trial, noise, rng, _SAMPLES_PER_FRAME))
        measured = read_measured(read_subject(recorded), rng)
        x, z, gain, turn = (
            float(rng.normal(0.0, prior.nominal_sd))
            for prior in (FLOOR_PRIOR["x"], FLOOR_PRIOR["z"], PLATE_PRIOR["gain"], FLOOR_PRIOR["turn"])
        )
        for change in (
            plates.moved(x_m=x, z_m=z),
            plates.scaled(force=1.0 + gain),
            plates.turned_about_vertical(float(np.degrees(turn))),
        ):
            measured = change(measured, rng) or measured
        laboratory = folder / f"{number}"
        laboratory.mkdir()
        laboratories[f"laboratory {number}"] = read_subject(write_person(laboratory, measured))
    return laboratories


def synthetic_walk(folder: Path) -> SubjectFile:
    """Write files of the package's own walk, in a careful laboratory, into this folder."""
    subject = walking_subject()
    trial = walk(subject, _WALK_S, _PLATE_RATE_HZ, _START)
    recordings = record(subject, trial, LabNoise(), np.random.default_rng(1), _SAMPLES_PER_FRAME)
    return read_subject(write_lab(folder, recordings))


def _sound(case: tuple[str, SubjectFile]) -> SoundWalk:
    name, subject = case
    with TemporaryDirectory() as folder:
        path = write_person(Path(folder), _person(subject, name))
        by_check = checked(path)
        findings, moments = by_check, None
        try:
            fit = fit_subject(path)
        except KinertiaError as error:
            findings = findings_of(error) or by_check
        else:
            findings, moments = fit.findings, moments_of(fit)
    return SoundWalk(name, subject, findings, by_check, moments)


def _spoilt(case: tuple[SoundWalk, str]) -> FaultOutcome:
    sound, name = case
    return outcome_of(sound, next(candidate for candidate in MISTAKES if candidate.name == name))


def outcome_of(sound: SoundWalk, mistake: Mistake) -> FaultOutcome:
    """Inject the fault into the files of the walk, and return the outcome."""
    person = mistake.change(_person(sound.subject, sound.name), np.random.default_rng(_seed(mistake.name)))
    case = FaultOutcome(sound.name, mistake.name, "not possible")
    if person is None:
        return case
    with TemporaryDirectory() as folder:
        path = write_person(Path(folder), person)
        by_check = judged(case, mistake, sound.checked, checked(path), "check")
        if by_check is not None and by_check.outcome == "identified":
            return by_check
        try:
            fit = fit_subject(path)
        except KinertiaError as error:
            by_fit = judged(case, mistake, sound.findings, findings_of(error), "fit")
            return by_check or by_fit or replace(case, outcome="warned", said=str(error), by="fit")
    sd, nm = change(sound.moments, moments_of(fit))
    silent = replace(case, outcome="harmless" if sd <= 1.0 else "unnoticed")
    by_fit = judged(case, mistake, sound.findings, fit.findings, "fit")
    return replace(by_fit or by_check or silent, change_sd=sd, change_nm=nm)


def _person(subject: SubjectFile, name: str) -> MeasuredPerson:
    return read_measured(subject, np.random.default_rng(_seed(name)))


def _seed(name: str) -> list[int]:
    return list(name.encode())


def checked(subject: Path) -> tuple[Finding, ...]:
    """Return the findings of `kinertia check`."""
    try:
        return check_person(read_person(read_subject(subject))).findings
    except KinertiaError as error:
        return findings_of(error)


def judged(
    case: FaultOutcome, mistake: Mistake, sound: Sequence[Finding], findings: Sequence[Finding], by: str
) -> FaultOutcome | None:
    """Return the outcome by new findings compared with the fault-free files: "identified" where a code of the fault is
    among them, "warned" where only others are; None where nothing is new.
    """
    new = [finding for finding in reported(findings) if _is_new(finding, reported(sound))]
    naming = [finding for finding in new if finding.code in mistake.codes]
    if not new:
        return None
    first = (naming or new)[0]
    outcome: Outcome = "identified" if naming else "warned"
    return replace(case, outcome=outcome, code=first.code, said=first.message, by=by)


def _is_new(finding: Finding, before: Sequence[Finding]) -> bool:
    """Return whether no earlier finding of its kind is at least as severe and of about the same size."""
    same = [other for other in before if other.code == finding.code and other.where.overlaps(finding.where)]
    return not any(
        other.severity >= finding.severity and not _differ(finding.headline, other.headline) for other in same
    )


def _differ(quantity: Quantity | None, other: Quantity | None) -> bool:
    if quantity is None or other is None or quantity.sd is None or not isinstance(quantity.value, float):
        return False
    return isinstance(other.value, float) and abs(quantity.value - other.value) > _CHANGED_SD * quantity.sd


def moments_of(fit: Fit) -> JointMoments:
    """Return the joint moments of the legs in the first trial."""
    trial = fit.trials[0]
    table, deviation = trial.moments["estimate"], trial.moment_sd
    legs = [name for name in table.columns if _LEGS.match(name)]
    sd = np.full((len(table), len(legs)), np.nan) if deviation is None else deviation[legs].to_numpy()
    return JointMoments(trial.time, tuple(legs), table[legs].to_numpy(), sd)


def change(sound: JointMoments | None, other: JointMoments) -> tuple[float, float]:
    """Return the largest RMS change of a moment over its RMS SD, and that change in N m, over the common time."""
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
