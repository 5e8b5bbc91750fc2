"""Defines `Prepared`: all input of an estimator for one person."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from kinertia.estimation.input_checks import known
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.model_uncertainty import ModelUncertainty
from kinertia.estimation.total_mass import TotalMass
from kinertia.findings.finding import Finding
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.settings import Attached, Overrule, Settings, Subject

Progress = Callable[[str, float], None]
"""Called with the name of the stage and the share of it that is done (0 to 1)."""


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
            (`joint_adaptation.elbow_rotations`).
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
