"""Builds the prior of the simultaneous estimate: how far parameters may be from the literature.

Standard deviations and their sources (4a, 4b: Zatsiorsky 2002, segment by segment, 4b after regression on mass
and height; 4c: the spread between published methods):

- mass: the larger of the between-subject residual deviation given mass and height (4b: thigh 7 %, shank 7 %, foot 10
  %, upper arm 9 %, forearm 9 %, trunk parts 10-12 %) and the spread between methods (4c: thigh 14 %, upper arm 16 %,
  foot 15 %);
- CoM: 3.5 % of the segment's length along it (4a: 1.2-5.6 % of length), and 5 % of the length across it, or 8 mm (no
  source gives the transverse deviation; tables differ by that much from one another); 10 mm to the side for pelvis and
  torso, which are nearly symmetric (no source; organs are not);
- inertia: 20 % on the second moment of the mass in every direction, half of the variance common to all directions; for
  moments of inertia this amounts to 16-20 % (4b: 12-24 %, similar in all directions). They cannot vary independently:
  with 20 % on each, hardly one draw in a thousand would be physically possible.

Correlations: mass cut from the thigh goes to the trunk (the hip's cut plane is a matter of definition, 4c), and left
and right differ less from each other than from the literature: people are nearly, but not exactly, symmetric.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
from scipy.linalg import block_diag

from kinertia.errors import PriorError
from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters, inertia_of, second_moments
from kinertia.model.log_cholesky import nearest_consistent

MASS_SD = {
    "pelvis": 0.14,
    "torso": 0.08,
    "thigh": 0.14,
    "shank": 0.07,
    "foot": 0.15,
    "upper_arm": 0.16,
    "forearm": 0.10,
}
"""Relative standard deviation of the mass, by segment."""
OTHER_MASS_SD = 0.15
"""Relative standard deviation of the mass of any other segment."""
COM_ALONG_SD, COM_ACROSS_SD, SMALLEST_COM_SD_M, MIDLINE_SD_M = 0.035, 0.05, 0.008, 0.010
SECOND_MOMENT_SD, COMMON_SHARE = 0.20, 0.5
"""Relative standard deviation of second moments, and the share of its variance common to all directions (size)."""
SIDES_CORRELATION = 0.9
THIGH_TRUNK_CORRELATION = -0.35
SCALE_SD = 0.005
"""Relative standard deviation of the body mass on the scale."""


@dataclass(frozen=True, eq=False)
class BspPrior:
    """Gaussian prior of body segment parameters, with the total mass measured by the scale.

    Attributes:
        mean: need not be physically consistent (a start with errors of 50 % is not); estimates always are.
        covariance: (10 s, 10 s) of the table rows (mass, CoM, moments, products), segment after segment.
        mass_kg, mass_sd_kg: the total mass by the scale, and its standard deviation.
        weighed: (s,) whether the scale's mass includes each segment; None: all.

    Raises:
        PriorError: the covariance has the wrong shape or is not positive definite, or a standard deviation is not
            positive.

    Examples:
        >>> from dataclasses import replace
        >>> prior = kinertia.literature_prior(kinertia.walking_subject().literature)
        >>> wide = replace(prior, covariance=4.0 * prior.covariance)  # twice the deviations
        >>> bool(np.allclose(wide.sd, 2.0 * prior.sd))
        True
    """

    mean: BodySegmentParameters
    covariance: np.ndarray
    mass_kg: float
    mass_sd_kg: float
    weighed: tuple[bool, ...] | None = None

    def __post_init__(self) -> None:
        size = 10 * len(self.mean.segments)
        if self.covariance.shape != (size, size):
            raise PriorError(
                f"the covariance is {' x '.join(map(str, self.covariance.shape))}; expected {size} x {size}, ten "
                f"parameters for each of {len(self.mean.segments)} segments"
            )
        variances = np.diag(self.covariance)
        if not np.all(variances > 0):
            k = int(np.argmin(variances > 0))
            name = f"{self.mean.segments[k // 10]}.{PARAMETERS[k % 10]}"
            raise PriorError(f"the variance of {name} is {variances[k]:g}; every variance must be positive", name)
        if not self.mass_sd_kg > 0:
            raise PriorError(f"the standard deviation of the body mass is {self.mass_sd_kg:g} kg; it must be positive")
        correlation = self.covariance / np.outer(self.sd, self.sd)
        if not np.allclose(correlation, correlation.T):
            raise PriorError("the covariance is not symmetric")
        smallest = float(np.linalg.eigvalsh(correlation)[0])
        if smallest <= 0:
            raise PriorError(
                f"the covariance is not positive definite (smallest eigenvalue of the correlations {smallest:.2g}); "
                f"lower the correlations"
            )

    @property
    def sd(self) -> np.ndarray:
        """Prior SDs (s, 10), in the table's order and units."""
        return np.sqrt(np.diag(self.covariance)).reshape(-1, 10)

    @property
    def on_scale(self) -> np.ndarray:
        """Indicator (s,): 1 for segments included in the scale's mass, 0 for others."""
        return np.ones(len(self.mean.segments)) if self.weighed is None else np.array(self.weighed, dtype=float)

    def at_mass(self, mass_kg: float, sd_kg: float) -> Self:
        """Return the prior of a person of the same build with this mass, known to this standard deviation."""
        factor = mass_kg / self.mass_kg
        rows = np.where(np.isin(PARAMETERS, ("com_x", "com_y", "com_z")), 1.0, factor)
        each = np.tile(rows, len(self.mean.segments))
        mean = BodySegmentParameters.from_table(self.mean.segments, self.mean.table() * rows)
        return replace(
            self, mean=mean, covariance=self.covariance * np.outer(each, each), mass_kg=mass_kg, mass_sd_kg=sd_kg
        )

    def given_scale(self) -> tuple[np.ndarray, np.ndarray]:
        """Return mean (10 s,) and covariance (10 s, 10 s) of the table rows, given that the scale showed `mass_kg`."""
        scale = np.zeros(self.covariance.shape[0])
        scale[::10] = self.on_scale
        with_total = self.covariance @ scale
        variance = scale @ with_total + self.mass_sd_kg**2
        mean = self.mean.table().ravel() + with_total * (self.mass_kg - self.on_scale @ self.mean.mass_kg) / variance
        return mean, self.covariance - np.outer(with_total, with_total) / variance

    def draw(self, rng: np.random.Generator) -> BodySegmentParameters:
        """Draw a person from this prior given the scale's `mass_kg`, until every segment is physically possible."""
        mean, covariance = self.given_scale()
        sd = np.sqrt(np.diag(covariance))
        root = sd[:, None] * np.linalg.cholesky(covariance / np.outer(sd, sd))
        while True:
            table = mean + root @ rng.standard_normal(len(sd))
            person = BodySegmentParameters.from_table(self.mean.segments, table)
            if person.physically_consistent().all():
                return person


def literature_prior(literature: BodySegmentParameters, kinds: Sequence[str] | None = None) -> BspPrior:
    """Build the prior around literature values, or those of a scaled model, whose total mass is the scale's.

    Args:
        literature: the mean.
        kinds: per segment, a key of MASS_SD; a segment of any other kind gets OTHER_MASS_SD, and 5 % of its length in
            all directions. None: the segments' own names.
    """
    table = literature.table()
    sd = np.zeros_like(table)
    names = [segment.removesuffix("_r").removesuffix("_l") for segment in literature.segments]
    names = names if kinds is None else list(kinds)
    sd[:, 0] = table[:, 0] * [MASS_SD.get(name, OTHER_MASS_SD) for name in names]
    for row, name in enumerate(names):
        along = 0 if name == "foot" else 1
        length = 2.0 * (abs(table[row, 1 + along]) if name in MASS_SD else np.abs(table[row, 1:4]).max())
        sd[row, 1:4] = np.maximum(COM_ACROSS_SD * length, SMALLEST_COM_SD_M)
        if name in MASS_SD:
            sd[row, 1 + along] = max(COM_ALONG_SD * length, SMALLEST_COM_SD_M)
        if not literature.segments[row].endswith(("_r", "_l")):
            sd[row, 3] = MIDLINE_SD_M
    blocks = np.zeros((len(names), 10, 10))
    blocks[:, range(4), range(4)] = np.square(sd[:, :4])
    blocks[:, 4:, 4:] = inertia_covariance(nearest_consistent(literature))
    covariance = with_symmetry(block_diag(*blocks), literature.segments, SIDES_CORRELATION)
    for i, j in product(range(len(names)), repeat=2):
        if names[i] == "thigh" and names[j] in ("pelvis", "torso"):
            shared = THIGH_TRUNK_CORRELATION * np.sqrt(covariance[10 * i, 10 * i] * covariance[10 * j, 10 * j])
            covariance[10 * i, 10 * j] = covariance[10 * j, 10 * i] = shared
    total = literature.total_mass_kg
    return BspPrior(literature, covariance, total, SCALE_SD * total)


def inertia_covariance(bsp: BodySegmentParameters) -> np.ndarray:
    """Compute the covariance (s, 6, 6) of ixx, iyy, izz, ixy, ixz, iyz from isotropic changes of second moments.

    Second moments are L (1 + E) L^T. E is a common number on the diagonal plus a symmetric matrix whose off-diagonal
    elements have 1 / sqrt(2) times the standard deviation of the diagonal ones, so that it is isotropic. To first
    order, deviations are measured by the affine-invariant distance of Lee, Wensing and Park (2020, IEEE T-RO 36:182).
    """
    root = np.linalg.cholesky(second_moments(bsp.inertia_kgm2))
    own = SECOND_MOMENT_SD * np.sqrt(1.0 - COMMON_SHARE)
    changes = [SECOND_MOMENT_SD * np.sqrt(COMMON_SHARE) * np.eye(3)]
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        change = np.zeros((3, 3))
        change[i, j] = change[j, i] = own if i == j else own * np.sqrt(0.5)
        changes.append(change)
    columns = []
    for change in changes:
        inertia = inertia_of(root @ change @ root.transpose(0, 2, 1))
        columns.append(inertia[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    factor = np.stack(columns, axis=-1)
    return factor @ factor.transpose(0, 2, 1)


def with_symmetry(covariance: np.ndarray, segments: tuple[str, ...], correlation: float) -> np.ndarray:
    """Return the covariance with this correlation between each right segment and the mirror image of its left one."""
    result = covariance.copy()
    for i, segment in enumerate(segments):
        if segment.endswith("_r") and f"{segment[:-2]}_l" in segments:
            j = segments.index(f"{segment[:-2]}_l")
            right, left = slice(10 * i, 10 * i + 10), slice(10 * j, 10 * j + 10)
            mirror = np.diag(MIRROR_SIGNS)
            one, other = np.linalg.cholesky([covariance[right, right], mirror @ covariance[left, left] @ mirror])
            result[right, left] = correlation * one @ other.T @ mirror
            result[left, right] = result[right, left].T
    return result


def updated(
    mean: np.ndarray, covariance: np.ndarray, seen: np.ndarray, values: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean (n,) and covariance (n, n) given `values` (m,) = `seen` (m, n) x, measured with errors.

    The errors have the covariance `noise` (m, m).

    >>> mean, covariance = updated(np.zeros(1), np.eye(1), np.eye(1), np.ones(1), np.eye(1))
    >>> float(mean[0]), float(covariance[0, 0])
    (0.5, 0.5)
    """
    across = seen @ covariance
    gain = np.linalg.solve(across @ seen.T + noise, across).T
    left = covariance - gain @ across
    return mean + gain @ (values - seen @ mean), 0.5 * (left + left.T)
