"""What both sources of a model, the built-in one and a user's file, make of a person and the trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.model_uncertainty import ModelUncertainty
from kinertia.findings.finding import Finding
from kinertia.model.skeleton import Skeleton
from kinertia.settings import Subject
from kinertia.workflow.kinematics import Turned

LOWER_BODY_SD_M = 0.01
UPPER_BODY_SD_M = 0.04
"""How far markers may sit from where the model has them."""


@dataclass(frozen=True, eq=False)
class PersonModel:
    """A model adapted to a person and the trials, before these are solved.

    Attributes:
        subject: with what the files add.
        note: which model it is.
        trials: those that can go on, in the axes in which they are solved.
        skeleton: adapted to them.
        prior: of the body segment parameters.
        uncertainty: what else the estimate may move.
        findings: what adapting it showed.
        assumed: findings of what was done to the model on the way.
        elbow_rotations_rad, torso_rotation_rad: as in `Prepared`.
    """

    subject: Subject
    note: str
    trials: Sequence[Turned]
    skeleton: Skeleton
    prior: BspPrior
    uncertainty: ModelUncertainty
    findings: Sequence[Finding] = ()
    assumed: Sequence[Finding] = ()
    elbow_rotations_rad: Mapping[str, float] = field(default_factory=dict)
    torso_rotation_rad: float | None = None
