"""Estimates a person with another prior, from the information in the recordings alone."""

import numpy as np

from kinertia.estimation.learnt_prior import PersonInformation, relative_parameters
from kinertia.estimation.prior import BspPrior
from kinertia.model.bsp import BodySegmentParameters

_STEPS, _SETTLED = 50, 1e-6


def with_prior(person: PersonInformation, prior: BspPrior) -> tuple[BodySegmentParameters, np.ndarray]:
    """Combine the recordings with this prior: return the estimate and the covariance (10 s, 10 s) of its table."""
    sd, literature = person.literature.sd.ravel(), person.literature.mean.table().ravel()
    mean = (prior.mean.table().ravel() - literature) / sd
    before = np.linalg.inv(prior.covariance / np.outer(sd, sd))

    def body_of(relative: np.ndarray) -> BodySegmentParameters:
        return BodySegmentParameters.from_table(person.segments, (literature + sd * relative).reshape(-1, 10))

    def cost(relative: np.ndarray) -> float:
        _, dynamic = relative_parameters(person.literature, body_of(relative))
        away = relative - mean
        return float(dynamic @ (0.5 * person.information @ dynamic - person.rhs) + 0.5 * away @ before @ away)

    relative = mean
    for _ in range(_STEPS):
        along, dynamic = relative_parameters(person.literature, body_of(relative))
        curvature = along.T @ person.information @ along + before
        step = np.linalg.solve(
            curvature, along.T @ (person.rhs - person.information @ dynamic) - before @ (relative - mean)
        )
        while np.abs(step).max() > _SETTLED and cost(relative + step) > cost(relative):
            step = 0.5 * step
        relative = relative + step
        if np.abs(step).max() <= _SETTLED:
            break
    body = body_of(relative)
    return body, np.linalg.inv(curvature) * np.outer(sd, sd)
