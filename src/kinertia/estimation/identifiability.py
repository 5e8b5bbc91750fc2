"""Classifies each body segment parameter by how well gait determines it, and finds the determined combinations.

Ground reactions depend only on combinations of the parameters, the base parameters: mass on the axis of a joint can be
assigned to either of the segments that it connects, and no motion distinguishes them (Gautier and Khalil 1990, IEEE
T-RA 6:368). These combinations follow from the root regressor over random motions; those that a recorded motion
determines follow from the regressor over its frames, with columns in prior SDs of the parameters and rows in standard
deviations of the noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from kinertia.model.bsp import (
    MIRROR_SIGNS,
    PARAMETERS,
    UNITS,
    BodySegmentParameters,
    FloatArray,
    dynamic_by_table,
    partners,
)
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
_STUDY = 7
"""Parameters per segment: the first seven of `PARAMETERS`."""


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


@dataclass(frozen=True, eq=False)
class ParameterVector:
    """The study's unknowns theta: mass, com_x, com_y, com_z, ixx, iyy, izz of every segment or every pair.

    Principal axes lie along the segment axes: ixy, ixz, iyz are not in theta and keep the reference's values
    (zero in the study). Under symmetry a pair counts once, as its right segment, and the left segment mirrors the right
    one, including the fixed ixy, ixz, iyz. Twelve segments give 84 parameters, or 49 under symmetry.

    Attributes:
        reference: gives the segments, their order, and ixy, ixz, iyz.
        symmetric: whether left mirrors right.

    Raises:
        ValueError: under symmetry two would share a name (`hand_r`, `hand_l` and also `hand`).
    """

    reference: BodySegmentParameters
    symmetric: bool

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.names):
            raise ValueError(f"parameter names are not unique: {', '.join(self.names)}")

    @cached_property
    def _is_left(self) -> npt.NDArray[np.bool_]:
        # (s,) segments whose values mirror their partner's
        segments = self.reference.segments
        paired = partners(segments) != np.arange(len(segments))
        return np.array([self.symmetric and p and n.endswith("_l") for n, p in zip(segments, paired, strict=True)])

    @cached_property
    def _group(self) -> npt.NDArray[np.intp]:
        # (s,) which seven of theta a segment takes
        group = np.cumsum(~self._is_left) - 1
        return np.where(self._is_left, group[partners(self.reference.segments)], group)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names `<segment>.<parameter>` of all elements of theta; a pair drops its suffix ("thigh.mass")."""
        mirrored = set(self._group[self._is_left])
        groups = []
        for name, group, left in zip(self.reference.segments, self._group, self._is_left, strict=True):
            if not left:
                groups.append(name[:-2] if group in mirrored else name)
        return tuple(f"{group}.{parameter}" for group in groups for parameter in PARAMETERS[:_STUDY])

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every element of theta."""
        return UNITS[:_STUDY] * (len(self.names) // _STUDY)

    @property
    def lower_bounds(self) -> FloatArray:
        """Lower bounds of theta: 0 for masses (kg) and moments (kg m2), -inf for CoM coordinates (m)."""
        return np.tile([0.0, -np.inf, -np.inf, -np.inf, 0.0, 0.0, 0.0], len(self.names) // _STUDY)

    def values(self, bsp: BodySegmentParameters) -> FloatArray:
        """Return theta of these body segment parameters; under symmetry the mean of the right and the mirrored left.

        Raises:
            ValueError: the segments are not those of the reference.
        """
        return self._symmetrised(bsp)[~self._is_left, :_STUDY].ravel()

    def bsp(self, theta: npt.ArrayLike) -> BodySegmentParameters:
        """Return body segment parameters with this theta; the left mirrors the right under symmetry."""
        table = self._own_table.copy()
        table[:, :_STUDY] = self._grouped(theta) * self._signs
        return BodySegmentParameters.from_table(self.reference.segments, table)

    def jacobian(self, theta: npt.ArrayLike) -> FloatArray:
        """Compute the derivative (10 s, len(names)) of `bsp(theta).dynamic_parameters()` with respect to theta."""
        values = self._grouped(theta) * self._signs
        blocks = dynamic_by_table(values[:, 0], values[:, 1:4])[..., :_STUDY] * self._signs[:, None, :]
        jacobian = np.zeros((len(blocks), 10, len(self.names) // _STUDY, _STUDY))
        jacobian[np.arange(len(blocks)), :, self._group, :] = blocks
        return jacobian.reshape(10 * len(blocks), len(self.names))

    @cached_property
    def _own_table(self) -> FloatArray:
        # (s, 10) of the reference
        return self._symmetrised(self.reference)

    @cached_property
    def _signs(self) -> FloatArray:
        # (s, 7) factors from a segment's seven of theta to its own parameters
        return np.where(self._is_left[:, None], MIRROR_SIGNS[:_STUDY], 1.0)

    def _grouped(self, theta: npt.ArrayLike) -> FloatArray:
        # (s, 7) each segment's elements of theta
        vector = np.asarray(theta, dtype=float)
        if vector.shape != (len(self.names),):
            raise ValueError(f"theta has shape {vector.shape}; ({len(self.names)},) was expected")
        return vector.reshape(-1, _STUDY)[self._group]

    def _symmetrised(self, bsp: BodySegmentParameters) -> FloatArray:
        # (s, 10) table in which, under symmetry, pairs are the mean of either side and the mirrored other
        if bsp.segments != self.reference.segments:
            raise ValueError(f"segments {bsp.segments} are not those of the reference {self.reference.segments}")
        table = bsp.table()
        if self.symmetric:
            paired = partners(bsp.segments) != np.arange(len(bsp.segments))
            mirrored = table[partners(bsp.segments)] * MIRROR_SIGNS
            table[paired] = 0.5 * (table[paired] + mirrored[paired])
        return table
