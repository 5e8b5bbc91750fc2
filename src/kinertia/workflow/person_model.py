"""Defines the model of a person that both sources, the built-in model and a user's file, return."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kinertia.errors import SettingsError
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.model_uncertainty import ModelUncertainty
from kinertia.findings.finding import Finding
from kinertia.model.coordinate_range import UNKNOWN, Range
from kinertia.model.skeleton import Skeleton
from kinertia.settings import Subject
from kinertia.workflow.kinematics import RotatedTrial

LOWER_BODY_SD_M = 0.01
UPPER_BODY_SD_M = 0.04
"""How far markers may sit from where the model has them."""


@dataclass(frozen=True, eq=False)
class PersonModel:
    """A model adapted to a person and the trials, before these are solved.

    Attributes:
        subject: with what the files add.
        note: which model it is.
        trials: usable trials, in the axes in which they are solved.
        skeleton: adapted to them.
        prior: of the body segment parameters.
        uncertainty: what else the estimate may move.
        findings: what adapting it showed.
        assumed: findings about assumptions made for the model.
        elbow_rotations_rad, torso_rotation_rad: as in `Prepared`.
    """

    subject: Subject
    note: str
    trials: Sequence[RotatedTrial]
    skeleton: Skeleton
    prior: BspPrior
    uncertainty: ModelUncertainty
    findings: Sequence[Finding] = ()
    assumed: Sequence[Finding] = ()
    elbow_rotations_rad: Mapping[str, float] = field(default_factory=dict)
    torso_rotation_rad: float | None = None


def with_stated_ranges(skeleton: Skeleton, subject: Subject) -> Skeleton:
    """Replace ranges of motion of the skeleton by those in the subject file; clamped coordinates stay clamped.

    Raises:
        SettingsError: the model has no such coordinate.
    """
    ranges = dict(skeleton.ranges)
    for name, degrees in (subject.ranges_deg or {}).items():
        if name not in skeleton.coordinates:
            near = difflib.get_close_matches(name, skeleton.coordinates, n=1) or skeleton.coordinates[6:7]
            raise SettingsError.of_entry(
                "ranges_deg under [subject]", f"no coordinate {name} moves; there is {near[0]}"
            )
        low, high = np.radians(degrees).tolist()
        ranges[name] = Range(low, high, ranges.get(name, UNKNOWN).clamped, stated=True)
    return replace(skeleton, ranges=ranges)
