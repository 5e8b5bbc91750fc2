"""How wrong estimated body segment parameters are, beside the truth of a synthetic walk."""

import numpy as np

from kinertia.estimation.identifiability import ParameterVector
from kinertia.model.bsp import BodySegmentParameters


def errors(estimate: BodySegmentParameters, truth: BodySegmentParameters) -> tuple[float, float, float]:
    """Return RMS errors of mass (kg), CoM coordinates (m), moments of inertia (kg m2), of the study's 49 parameters."""
    vector = ParameterVector(truth, symmetric=True)
    rows = (vector.values(estimate) - vector.values(truth)).reshape(-1, 7)
    mass, com, inertia = (float(np.sqrt(np.mean(np.square(part)))) for part in np.split(rows, [1, 4], axis=1))
    return mass, com, inertia
