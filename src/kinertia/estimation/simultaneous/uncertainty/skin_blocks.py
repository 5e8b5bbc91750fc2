"""Models skin of a thigh that moves as a block after its foot has landed.

Measured over the bone of a walking person (Cereatti et al. 2017, J Biomech, doi 10.1016/j.jbiomech.2017.02.004), the
thigh's skin moves fore and aft by some 6 mm in the first 12 % of the stride, with twice the acceleration that it has
elsewhere. Markers that move together look like a thigh that swings: it leaves no residuals, from which the motion's
errors are derived (`motion_noise`). The error bars of hip flexion moments are longer there, by the effect of that
person's skin. Draws of the posterior are not wider.
"""

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.motion.joint_wrench import BodyJoint

GROWTH = 2.0
"""Of what the markers' errors make of the moment of hip flexion. With it 95 % intervals cover after heel strike, where
skin moves as measured, nearly as often as elsewhere."""
LASTS_S = 0.14
"""From landing on: 12 % of the stride of an unhurried walk."""


def block_growth(
    problem: MapProblem, k: int, static: np.ndarray, time: np.ndarray, joints: Sequence[BodyJoint] = ()
) -> np.ndarray:
    """Return factors (n, r) on what the markers' errors make of each moment at these times of trial k.

    The rows r are those of `MomentDerivatives`.

    Args:
        problem: of the estimate.
        k: the trial.
        static: the static unknowns as they are in it.
        time: (n,) s.
        joints: those of the moments after those of coordinates.
    """
    trial = problem.trials[k]
    rows = [*problem.skeleton.coordinates, *(f"{joint.label} {axis}" for joint in joints for axis in range(6))]
    ground = problem.loads.reactions(k, static).loaded_at(trial.time) > 0.0
    if trial.on_ground is not None:
        ground |= trial.on_ground
    landed = np.zeros_like(ground)
    landed[1:] = ground[1:] & ~ground[:-1]
    result = np.ones((len(time), len(rows)))
    for side, at in zip("rl", landed.T, strict=True):
        landings = np.append(-np.inf, trial.time[at])
        after = time - landings[np.searchsorted(landings, time, side="right") - 1] < LASTS_S
        result[np.ix_(after, [row in (f"hip_flexion_{side}", f"hip_{side} 0") for row in rows])] = GROWTH
    return result
