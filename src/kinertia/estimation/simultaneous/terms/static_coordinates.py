"""Adds joint centres and tilts of joint axes, which are the same in all trials."""

from typing import Any

import numpy as np

from kinertia.estimation.simultaneous.calibration_entry import AXIS, CENTRE, CalibrationEntry
from kinertia.estimation.simultaneous.inputs import STILL, Given
from kinertia.estimation.simultaneous.layout import Unknowns
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, Solution
from kinertia.model.neutral_joints import joint_and_axis


class StaticCoordinates(CostTerm):
    """Coordinates of the skeleton that do not move in time."""

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return one unknown per coordinate, normal about the value at which the skeleton has it locked."""
        known = given.calibration.coordinates
        start = np.array([given.skeleton.locked[name] for name in known])
        sd = np.array(list(known.values()))
        return (Unknowns(name=STILL, unit="m or rad", start=start, prior=sd, seen_by="both"),)

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return values with their standard deviations, and entries of their changes from the skeleton's values."""
        known = self.given.calibration.coordinates
        before = {**self.given.skeleton.locked, **self.given.calibration.before}
        turned = self.given.free.rotational[self.given.still]
        pairs = dict(zip(known, solution.pairs(self.layout[STILL]), strict=True))
        entries = [
            CalibrationEntry(
                kind="joint",
                joint=joint,
                quantity=AXIS if tilted else CENTRE,
                axis=axis,
                value=value - float(before[name]),
                prior_sd=known[name],
                sd=sd,
                unit="rad" if tilted else "m",
            )
            for (name, (value, sd)), tilted in zip(pairs.items(), turned, strict=True)
            for joint, axis in [joint_and_axis(name)]
        ]
        return {"coordinates": pairs, "calibration": tuple(entries)}
