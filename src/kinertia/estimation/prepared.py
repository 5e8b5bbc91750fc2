"""Holds all that an estimator needs of a person: `Prepared`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from kinertia.estimation.carried_mass import CarriedMass
from kinertia.estimation.input_checks import known
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.model_uncertainty import ModelUncertainty
from kinertia.findings.finding import Finding
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.settings import Attached, Overrule, Settings, Subject

Progress = Callable[[str, float], None]
"""Called with the stage's name and the share of it that is done (0 to 1)."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """All that an estimator needs of a person: what recordings become before any estimate.

    Attributes:
        subject: with mass and height filled in.
        settings: those that it was prepared with, and is estimated with.
        skeleton: calibrated model.
        literature: body segment parameters of its geometry; of an OpenSim model its own, at the person's mass.
        prior: how far the person's may be from them.
        uncertainty: what else the simultaneous estimate may move.
        file: the OpenSim model that the skeleton is from, if it is.
        kinematics: smoothed coordinates and ground reactions, one entry per trial.
        seconds: computing time by stage, one entry per trial.
        functional: kinematics of the trials whose markers alone are used.
        findings: what was found so far, with what explains and what overrules each.
        notes: how the trials were prepared, one sentence each.
        attached: what the person wore or carried.
        overrule, overrule_of: what the user overrules, everywhere and in single trials.
        left_out: names of the trials that could not be used.
        rules: how many rules were asked so far.
        elbow_rotations_rad: side ("r", "l") -> by how much the trials turned an elbow axis of the static trial
            (`arm_branch.elbow_rotations`).
        torso_rotation_rad: by how much calibration would have turned the torso under its markers, which were kept from
            it; None where it would not.

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
    def carried(self) -> CarriedMass:
        """What the scale says of the body, and of what the forces carry."""
        return CarriedMass.of(known(self.subject.mass_kg), self.attached)
