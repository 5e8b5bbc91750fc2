"""Defines `Prepared`, all input of an estimator for one person, and checks what is stated of the person."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

import numpy as np

from kinertia.errors import PriorError, SettingsError, SubjectError, TrialError, problem_of
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.priors import ModelUncertainty
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.io.file_names import trouble_as_folders
from kinertia.model.anthropometry import check_subject
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.settings import Attached, Overrule, Settings, Subject
from kinertia.trial.data import Recording

Progress = Callable[[str, float], None]
"""Called with the name of the stage and the share of it that is done (0 to 1)."""
T = TypeVar("T")
UNKNOWN_SHARE, UNKNOWN_SHARE_SD = 0.10, 0.15
"""Expected share of body mass of an object of unknown mass, and its standard deviation: anything up to 40 %."""
_LIGHTEST_KG = 10.0
"""Least plausible mass of a person (`check_subject`)."""
LIGHT_KG = 0.5
"""Groups of bodies with less total mass than this move with their joints, but are not estimated."""
CALIBRATED_M = Limit(0.03, "m")
"""By which calibration moves markers at most; preparation reports more."""
KNOWN_BODY_SD = Limit(3.0)
"""SDs from the prior that a stated segment, or a body built from measures, may be away."""
MODEL_MASS_SHARE = Limit(0.002)
"""By which a model's mass is scaled without a word."""


@dataclass(frozen=True)
class TotalMass:
    """Mass of the body alone and total mass with all attached objects, in kg.

    Attributes:
        body_kg: of the person alone, for the tables.
        total_kg, sd_kg: of the person with all attached objects, and its standard deviation apart from the scale's
            error.

    Examples:
        >>> pack = kinertia.Attached(
        ...     name="rucksack", segment="torso", mass_kg="10 +- 0.5", com_mm=[-200, 300, 0], on_scale=False
        ... )
        >>> from kinertia.estimation.prepared import TotalMass
        >>> TotalMass.of(70.0, [pack])
        TotalMass(body_kg=70.0, total_kg=80.0, sd_kg=0.5)
    """

    body_kg: float
    total_kg: float
    sd_kg: float

    def __str__(self) -> str:
        beside = self.total_kg - self.body_kg
        return f"{self.total_kg:.1f} kg" + (f", {beside:.1f} kg of it attached" if beside else "")

    @classmethod
    def of(cls, stated_mass_kg: float, attached: Sequence[Attached]) -> Self:
        """Compute the masses from the stated mass.

        Raises:
            PriorError: the objects weighed with the person leave no mass for the person.
        """
        masses = [(mass_of(item, stated_mass_kg), item.on_scale) for item in attached]
        body = stated_mass_kg - sum(mass for (mass, _), weighed in masses if weighed)
        if body < min(_LIGHTEST_KG, stated_mass_kg):
            names = ", ".join(item.name for item in attached if item.on_scale)
            problem = f"weighed with the person (on_scale = true), it leaves {body:.4g} kg of {stated_mass_kg:.4g} kg"
            left = {"left_kg": Quantity(body, "kg"), "name": Quantity(names), "problem": Quantity(problem)}
            found = with_evidence("S406", Where(part=names), left)
            raise PriorError.of(found)
        beside = [mass for mass, weighed in masses if not weighed]
        return cls(body, stated_mass_kg + sum(mass for mass, _ in beside), sum(sd * sd for _, sd in beside) ** 0.5)


def body_sd_kg(stated_mass_kg: float, attached: Sequence[Attached]) -> float:
    """Return the standard deviation of the body's mass due to objects weighed with it, without the scale's error."""
    variances = [mass_of(item, stated_mass_kg)[1] ** 2 for item in attached if item.on_scale]
    return float(sum(variances) ** 0.5)


def mass_of(attached: Attached, stated_mass_kg: float) -> tuple[float, float]:
    """Return the mass of one object and its standard deviation, kg, before any estimate."""
    if attached.mass_kg is None:
        return UNKNOWN_SHARE * stated_mass_kg, UNKNOWN_SHARE_SD * stated_mass_kg
    return attached.mass_kg


@dataclass(frozen=True, eq=False)
class Prepared:
    """All input of an estimator for one person: recordings, model and priors before any estimate.

    Attributes:
        subject: with mass and height filled in.
        settings: used for preparation and estimate.
        skeleton: calibrated model.
        literature: body segment parameters of its geometry; for an OpenSim model its own, at the person's mass.
        prior: prior of the person's parameters around these.
        uncertainty: what else the simultaneous estimate may change.
        file: the OpenSim model that the skeleton is from, or None.
        kinematics: smoothed coordinates and ground reactions, one entry per trial.
        seconds: computing time by stage, one entry per trial.
        functional: kinematics of the trials whose markers alone are used.
        findings: all so far, with what explains and what overrules each.
        notes: how the trials were prepared, one sentence each.
        attached: objects that the person wore or carried.
        overrule, overrule_of: findings that the user overrules, everywhere and in single trials.
        left_out: names of the trials that could not be used.
        rules: number of rules checked so far.
        elbow_rotations_rad: side ("r", "l") -> rotation of the static trial's elbow axis by the trials
            (`model_adaptation.elbow_rotations`).
        torso_rotation_rad: rotation of the torso under its markers that calibration would have made and that was
            prevented; None if there was none.

    Examples:
        >>> ready = kinertia.prepare_subject("lab/subject.toml")
        >>> [kinematics.trial.name for kinematics in ready.kinematics]
        ['walk']
    """

    subject: Subject
    settings: Settings
    skeleton: Skeleton
    literature: BodySegmentParameters
    prior: BspPrior
    uncertainty: ModelUncertainty
    file: OsimModel | None
    kinematics: tuple[Kinematics, ...]
    seconds: tuple[Mapping[str, float], ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]
    attached: tuple[Attached, ...] = ()
    overrule: Overrule = field(default_factory=Overrule)
    overrule_of: Mapping[str, Overrule] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    rules: int = 0
    elbow_rotations_rad: Mapping[str, float] = field(default_factory=dict)
    torso_rotation_rad: float | None = None
    functional: tuple[Kinematics, ...] = ()

    @property
    def total_mass(self) -> TotalMass:
        """Mass of the body alone and total mass that the forces support, from the stated mass."""
        return TotalMass.of(known(self.subject.mass_kg), self.attached)


def known(value: T | None) -> T:
    """Return the value of a field that the subject file or `complete_subject` has filled in."""
    if value is None:
        raise ValueError("complete_subject must come first")
    return value


def check_trials(recordings: Sequence[Recording]) -> None:
    """Raise an error unless there are trials, whose names distinguish their results.

    Raises:
        SettingsError: there is no trial.
        TrialError: a name is not usable as a folder beside those of the other trials.
    """
    if not recordings:
        raise SettingsError.of(finding("S301"))
    names = [recording.name for recording in recordings]
    if trouble := trouble_as_folders(names):
        index, problem = trouble
        advice = "results have a folder for each trial: give this one's recording another name (dataclasses.replace)"
        raise TrialError(names[index], f"{problem}; {advice}")


def complete_subject(subject: Subject, recordings: Sequence[Recording], mass_only: bool = False) -> Subject:
    """Fill in mass and height from the files where the user gave none.

    Args:
        subject, recordings: what the user states, and the files.
        mass_only: height and sex may stay unknown.

    Raises:
        SubjectError: neither the user nor a file gives mass or height, the user no sex, or a value is impossible.
    """
    if missing := lacking(subject, recordings, mass_only):
        quantities = ", ".join(missing.values())
        found = finding("S101", Where(part=quantities), quantity=Quantity(quantities))
        raise SubjectError(next(iter(missing)), None, problem_of(found)).with_finding(found)
    values = {field: _filed(subject, field, recordings) for field in ("mass_kg", "height_m")}
    completed = subject.model_copy(update={field: value for field, value in values.items() if value is not None})
    check_subject(
        known(completed.mass_kg), 1.7 if completed.height_m is None else completed.height_m, subject.sex or "male"
    )
    return completed


def lacking(subject: Subject, recordings: Sequence[Recording], mass_only: bool = False) -> dict[str, str]:
    """Return which of mass, stature and sex neither the user nor a file states: the fields, and their names.

    Args:
        subject, recordings: what the user states, and the files.
        mass_only: height and sex may stay unknown, as with an OpenSim model.
    """
    needed = {"mass_kg": "mass"} if mass_only else {"mass_kg": "mass", "height_m": "stature", "sex": "sex"}
    return {field: name for field, name in needed.items() if _filed(subject, field, recordings) is None}


def _filed(subject: Subject, field: str, recordings: Sequence[Recording]) -> Any:
    """Return the value that the user states, or else the first file that does; no file states the sex."""
    stated = [getattr(source, field, None) for source in (subject, *recordings)]
    return next((value for value in stated if value is not None), None)


def mass_by_force_kg(literature: BodySegmentParameters, foot_loads: np.ndarray, residual: np.ndarray) -> float:
    """Compute body mass (kg) from the vertical ground reaction over a window, for any acceleration of the CoM.

    The residual of the uncorrected motion is P = m (a + g) - F with the literature's m, so the mass that leaves no
    mean vertical residual is m F / (F + P), with means over the window.

    Args:
        literature: the BSPs of the residual.
        foot_loads: (w, 2, 6) ground reactions.
        residual: (w, 6) root residual of the literature BSPs on the uncorrected motion.
    """
    force = float(foot_loads[:, :, 1].sum(axis=1).mean())
    return literature.total_mass_kg * force / (force + float(residual[:, 1].mean()))


def estimated_bodies(skeleton: Skeleton, filed: BodySegmentParameters) -> set[str]:
    """Select the heaviest body of every group that moves as one; none of a group lighter than `LIGHT_KG` in total.

    Args:
        skeleton: with the coordinates locked that no marker determines.
        filed: the model's own parameters, at the mass of the person.
    """
    mass = dict(zip(filed.segments, filed.mass_kg, strict=True))
    groups: dict[int, list[str]] = {}
    last_axis_of = dict(zip(skeleton.segments, skeleton.tree.last_axis.tolist(), strict=True))
    for name in filed.segments:
        groups.setdefault(last_axis_of[name], []).append(name)
    heavy = [names for names in groups.values() if sum(mass[name] for name in names) >= LIGHT_KG]
    return {max(names, key=mass.__getitem__) for names in heavy}
