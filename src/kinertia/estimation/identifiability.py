"""Classifies each body segment parameter by how well gait determines it, and finds the determined combinations.

Ground reactions depend only on combinations of the parameters, the base parameters: mass on the axis of a joint can be
assigned to either of the segments that it connects, and no motion distinguishes them (Gautier and Khalil 1990, IEEE
T-RA 6:368). These combinations follow from the root regressor over random motions; those that a recorded motion
determines follow from the regressor over its frames, with columns in prior SDs of the parameters and rows in standard
deviations of the noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters, dynamic_by_table
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, root_regressor
from kinertia.motion.workload import pieces

MEASURED, INFORMED = 0.75, 0.25
"""Variance reduction above which a parameter counts as well informed ("measured"), as partly informed ("informed")."""
_RANDOM_STATES = 60
_ROUNDING = 1e-8
"""Share of the largest singular value below which a singular value counts as zero."""
_ENOUGH_FRAMES = 6000
"""Longer motions are sampled at about this many frames, one of every few neighbours, weighted for all of them. Gains of
synthetic walks of up to ten minutes change by less than 1 %."""
_FRAMES_AT_ONCE = 200
"""Number of frames whose equations are reduced at once: larger matrices exceed the processor's cache."""
_LISTED = 6
_NAMED_SHARE = 0.85
_MOST_NAMES = 4
_QUANTITIES = {
    "mass": "mass",
    "com_x": "CoM forward",
    "com_y": "CoM upward",
    "com_z": "CoM sideways",
    **{name: f"inertia {name}" for name in PARAMETERS[4:]},
}
_PLURALS = {"foot": "feet", "calcn": "heels"}


def evidence(information: float) -> str:
    """Classify the variance reduction (0 to 1) of a parameter: "measured", "informed" or "assumed"; "held" if NaN.

    NaN stands for a parameter that was not estimated.
    """
    if np.isnan(information):
        return "held"
    return "measured" if information > MEASURED else "informed" if information >= INFORMED else "assumed"


@dataclass(frozen=True)
class Combination:
    """A combination of body segment parameters that a motion determines.

    Attributes:
        words: the parameters in it, largest share first.
        gain: prior SD of the combination over the standard deviation with which these frames would determine it if the
            motion were known exactly.
        weights: "segment.parameter" -> share, in prior SDs; their squares sum to one.
    """

    words: str
    gain: float
    weights: Mapping[str, float]


@dataclass(frozen=True)
class BaseParameters:
    """Combinations of body segment parameters that the root equations determine, and those that they cannot.

    Attributes:
        count: number of combinations that some motion of the model determines.
        shown: number of them that this motion determines better than the prior (gain above one, motion known exactly).
        condition: largest over smallest gain of the base parameters.
        best: the best determined combinations, best first.
        never: combinations that no motion of this model determines, one phrase each.
    """

    count: int
    shown: int
    condition: float
    best: tuple[Combination, ...]
    never: tuple[str, ...]


def base_parameters(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    prior_sd: np.ndarray,
    motions: Sequence[Motion],
    root_sd: Sequence[np.ndarray],
) -> BaseParameters:
    """Compute which combinations these motions determine, and which no motion determines.

    Args:
        skeleton, bsp: the model.
        prior_sd: (s, 10) prior SDs of the parameters, in the order of `BodySegmentParameters.table`.
        motions: frames whose ground contact is measured, one entry per trial.
        root_sd: per trial (6,) standard deviations of the root load: N, N m.
    """
    scale = block_diag(*dynamic_by_table(bsp.mass_kg, bsp.com_m)) * prior_sd.ravel()
    anything = _scaled_regressor(skeleton, bsp, _random_motion(len(skeleton.coordinates)), np.ones(6)) @ scale
    singular = np.linalg.svd(anything, compute_uv=False)
    rounding = _ROUNDING * float(singular[0])
    count = int((singular > rounding).sum())
    if not any(len(motion.q) for motion in motions):
        return BaseParameters(count, 0, float("inf"), (), _never(skeleton, bsp.segments, anything, count, rounding))
    every = -(-sum(len(motion.q) for motion in motions) // _ENOUGH_FRAMES)
    parts = [
        np.linalg.qr(_scaled_regressor(skeleton, bsp, motion.cut(chosen[some]), sd / np.sqrt(every)) @ scale, mode="r")
        for motion, sd in zip(motions, root_sd, strict=True)
        for chosen in [_one_of(every, len(motion.q))]
        for some in pieces(len(chosen), _FRAMES_AT_ONCE)
    ]
    _, gains, vectors = np.linalg.svd(np.linalg.qr(np.concatenate(parts), mode="r"), full_matrices=False)
    gains = np.pad(gains, (0, max(0, count - len(gains))))[:count]
    names = [f"{segment}.{parameter}" for segment in bsp.segments for parameter in PARAMETERS]
    best = tuple(
        Combination(_words(bsp.segments, vector), float(gain), dict(zip(names, map(float, vector), strict=True)))
        for gain, vector in zip(gains[:_LISTED], _signed(vectors), strict=False)
    )
    condition = float(gains[0] / gains[-1]) if gains[-1] > 0 else float("inf")
    return BaseParameters(
        count, int((gains > 1.0).sum()), condition, best, _never(skeleton, bsp.segments, anything, count, rounding)
    )


def _one_of(every: int, count: int) -> np.ndarray:
    """Draw one frame from every block of `every` neighbours: even steps might sample only few phases of a gait."""
    starts = np.arange(0, count - every + 1, every)
    return starts + np.random.default_rng(0).integers(0, every, len(starts))


def _scaled_regressor(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, root_sd: np.ndarray
) -> np.ndarray:
    rows = root_regressor(skeleton, bsp.segments, motion) / root_sd[:, None]
    result: np.ndarray = rows.reshape(-1, rows.shape[-1])
    return result


def _random_motion(count: int) -> Motion:
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.uniform(-1.0, 1.0, (3, _RANDOM_STATES, count))
    return Motion(q, 3.0 * qd, 30.0 * qdd)


def _signed(vectors: np.ndarray) -> np.ndarray:
    """Flip the signs of vectors (k, p) so that their largest element is positive."""
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=1)[:, None], axis=1)
    result: np.ndarray = vectors * np.sign(largest)
    return result


def _words(segments: Sequence[str], vector: np.ndarray) -> str:
    """Describe the parameters in a combination; equal or opposite (mirrored) changes of both sides count as one."""
    rows = vector.reshape(-1, len(PARAMETERS))
    terms: list[tuple[float, str]] = []
    for i, segment in enumerate(segments):
        stem, side = segment[:-2], segment[-2:]
        paired = side in ("_r", "_l") and {f"{stem}_r", f"{stem}_l"} <= set(segments)
        for k, parameter in enumerate(PARAMETERS):
            value, name = rows[i, k], segment
            if paired:
                right = rows[segments.index(f"{stem}_r"), k]
                left = rows[segments.index(f"{stem}_l"), k] * MIRROR_SIGNS[k]
                alike, opposite = right + left, right - left
                if min(abs(alike), abs(opposite)) <= 0.25 * max(abs(alike), abs(opposite)):
                    if side == "_l":
                        continue
                    same = abs(alike) > abs(opposite)
                    value = (alike if same else opposite) / np.sqrt(2.0)
                    name = f"both {_PLURALS.get(stem, stem + 's')}" if same else f"the right {stem} and not of the left"
            terms.append((float(value), f"{_QUANTITIES[parameter]} of {name}"))
    terms.sort(key=lambda term: -abs(term[0]))
    phrases: list[str] = []
    share = 0.0
    for value, name in terms[:_MOST_NAMES]:
        phrases.append(f"{'with' if value * terms[0][0] > 0 else 'against'} {name}" if phrases else name)
        share += value**2
        if share > _NAMED_SHARE:
            break
    return ", ".join(phrases) + ("" if share > _NAMED_SHARE else ", and others")


def _never(
    skeleton: Skeleton, segments: Sequence[str], anything: np.ndarray, count: int, rounding: float
) -> tuple[str, ...]:
    """Describe the null space (columns of `anything`), joint by joint; singular values up to `rounding` are zero."""
    phrases, explained = [], 0
    for parent, child in _neighbours(skeleton, segments):
        columns = np.concatenate([10 * segments.index(name) + np.arange(10) for name in (parent, child)])
        singular = np.linalg.svd(anything[:, columns], compute_uv=False)
        hidden = int((singular <= rounding).sum())
        explained += hidden
        if hidden:
            phrases.append(_hidden_between(parent, child, hidden))
    rest = anything.shape[1] - count - explained
    if rest > 0:
        phrases.append(f"{rest} more combinations of several segments")
    return tuple(phrases)


def _hidden_between(parent: str, child: str, hidden: int) -> str:
    if hidden == 1:
        return f"mass moving between {parent} and {child} at the centre of their joint"
    if hidden == 3:
        return f"mass moving between {parent} and {child} on the axis of their joint, with any distribution along it"
    if hidden == len(PARAMETERS):
        return f"anything moving between {parent} and {child}: their joint is fixed"
    return f"{hidden} combinations of {parent} and {child}"


def _neighbours(skeleton: Skeleton, segments: Sequence[str]) -> list[tuple[str, str]]:
    """Return pairs of segments with mass that are connected by a joint, or by joints with massless segments between."""
    parents = {joint.child: joint.parent for joint in skeleton.joints}
    pairs = []
    for child in segments:
        parent = parents[child]
        while parent in parents and parent not in segments:
            parent = parents[parent]
        if parent in segments:
            pairs.append((parent, child))
    return pairs
