"""Builds the prior of the estimate: how far parameters may be from the literature, also of people unlike its tables.

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

The tables describe young adults of ordinary build (de Leva's men were 24 years old, body-mass index 24). Published
numbers for other populations are used, with their source; where there are none, none are invented: standard deviations
are multiplied by 1.5. The one group with known numbers supports this factor: including the spread of people, the masses
that Pavol found in the elderly are 1.58 times the tables' standard deviations from Dumas' values, and 1.33 times from
de Leva's.

- elderly: segment masses by Pavol, Owings and Grabiner (2002, J Biomech 35:707), whose table was available in one
  transcription only; trunk and head together keep the tables' split between pelvis and torso, since the trunk is cut
  elsewhere in that study. Standard deviations of masses stay, those of centres of mass and inertias grow.
- child: head and trunk are heavier, thighs, shanks and feet lighter than an adult's (Jensen 1986, J Biomech 19:359);
  his coefficients could not be checked. Standard deviations grow.
- other: anyone else whom the tables do not describe, for example pregnant or very muscular people. Standard deviations
  grow.
- obese: trunks are heavier, thighs and shanks lighter for the same mass (Chambers et al. 2010, Clin Biomech 25:131,
  people over 65); de Leva's masses were wrong by up to 60 % on average in a sample of working adults (Merrill et al.
  2019). Standard deviations grow.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
from scipy.linalg import block_diag

from kinertia.errors import PriorError
from kinertia.findings.finding import Finding, Severity, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters, inertia_of, second_moments
from kinertia.model.log_cholesky import nearest_consistent
from kinertia.settings import Subject

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
UNKNOWN_SPREAD = 1.5
"""Factor on standard deviations where no published numbers exist."""
GROWN_UP_YEARS, OLD_YEARS = 18.0, 65.0
OBESE_KG_M2 = 30.0
"""Body-mass index from which a person counts as obese (WHO)."""
_SHORT_M = 1.4
"""Stature below which a person without a stated age is likely a child, and in any case not described by the tables."""
_PAVOL = {
    "male": {"thigh": 0.1127, "shank": 0.0441, "foot": 0.0127, "upper_arm": 0.0299, "forearm": 0.0175 + 0.0065},
    "female": {"thigh": 0.1162, "shank": 0.0456, "foot": 0.0123, "upper_arm": 0.0301, "forearm": 0.0141 + 0.0054},
}
"""Shares of body mass; forearm and hand together."""


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
        factors = np.tile(rows, len(self.mean.segments))
        mean = BodySegmentParameters.from_table(self.mean.segments, self.mean.table() * rows)
        return replace(
            self, mean=mean, covariance=self.covariance * np.outer(factors, factors), mass_kg=mass_kg, mass_sd_kg=sd_kg
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
    sd = SECOND_MOMENT_SD * np.sqrt(1.0 - COMMON_SHARE)
    changes = [SECOND_MOMENT_SD * np.sqrt(COMMON_SHARE) * np.eye(3)]
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        change = np.zeros((3, 3))
        change[i, j] = change[j, i] = sd if i == j else sd * np.sqrt(0.5)
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
            right_root, left_root = np.linalg.cholesky(
                [covariance[right, right], mirror @ covariance[left, left] @ mirror]
            )
            result[right, left] = correlation * right_root @ left_root.T @ mirror
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


@dataclass(frozen=True)
class Population:
    """Population that the person belongs to, the reason, and whether it or the age that it follows from is stated."""

    name: str
    reason: str
    stated: bool

    def finding(self, subject: Subject) -> Finding | None:
        """Make S401 if the tables do not describe this population, else return None."""
        if self.name == "adult":
            return None
        evidence = {"population": Quantity(self.name), "reason": Quantity(self.reason)}
        if subject.mass_kg is not None and subject.height_m is not None:
            evidence["bmi"] = Quantity(subject.mass_kg / subject.height_m**2, "kg/m2", limit=OBESE_KG_M2)
        if subject.age_years is not None:
            evidence["age"] = Quantity(subject.age_years, "a")
        return with_evidence("S401", Where(), evidence, Severity.INFO if self.stated else Severity.WARNING)


@dataclass(frozen=True, eq=False)
class PopulationPrior:
    """A prior, with findings about what was assumed for it."""

    prior: BspPrior
    findings: tuple[Finding, ...]


def population_prior(prior: BspPrior, subject: Subject, body_kg: float | None = None) -> PopulationPrior:
    """Return the prior for this person's population, as stated or inferred from age and body-mass index.

    Args:
        prior: from the literature or a scaled model.
        subject: mass and height may be unknown.
        body_kg: mass of the body alone, where objects were weighed with it; None: the mass of the subject.
    """
    population = population_of(subject, body_kg)
    if population.name == "elderly" and subject.sex is not None:
        prior = _spread(_with_masses(prior, _PAVOL[subject.sex]), keep_masses=True)
    elif population.name != "adult":
        prior = _spread(prior)
    assumed = population.finding(subject)
    return PopulationPrior(prior, () if assumed is None else (assumed,))


def population_of(subject: Subject, body_kg: float | None = None) -> Population:
    """Return the stated population, or infer it from age, body-mass index and stature.

    Arguments are as in `population_prior`.
    """
    if subject.population is not None:
        return Population(subject.population, "the stated population", True)
    return _by_age_and_build(subject, body_kg or subject.mass_kg)


def _by_age_and_build(subject: Subject, mass_kg: float | None) -> Population:
    age, height_m = subject.age_years, subject.height_m
    if age is not None and age < GROWN_UP_YEARS:
        return Population("child", f"an age of {age:g} years", True)
    if mass_kg and height_m and mass_kg / height_m**2 >= OBESE_KG_M2:
        return Population("obese", f"a body-mass index of {mass_kg / height_m**2:.1f} kg/m2", False)
    if age is None and height_m is not None and height_m < _SHORT_M:
        return Population("child", f"a height of {height_m:g} m and no stated age", False)
    if age is not None and age >= OLD_YEARS:
        return Population("elderly", f"an age of {age:g} years", True)
    return Population("adult", "no evidence of another", False)


def _with_masses(prior: BspPrior, shares: dict[str, float]) -> BspPrior:
    """Return the prior with these shares of body mass for the limbs, and the rest for trunk and head; shapes stay."""
    mean = prior.mean
    kinds = [name.removesuffix("_r").removesuffix("_l") for name in mean.segments]
    total = mean.total_mass_kg
    mass = np.array([shares.get(kind, 0.0) * total for kind in kinds])
    rest = np.array([kind not in shares for kind in kinds])
    mass[rest] = (total - mass.sum()) * mean.mass_kg[rest] / mean.mass_kg[rest].sum()
    factor = mass / mean.mass_kg
    moved = BodySegmentParameters(mean.segments, mass, mean.com_m, mean.inertia_kgm2 * factor[:, None, None])
    scale = np.ones((len(kinds), 10))
    scale[:, [0, *range(4, 10)]] = factor[:, None]
    return replace(prior, mean=moved, covariance=prior.covariance * np.outer(scale, scale))


def _spread(prior: BspPrior, keep_masses: bool = False) -> BspPrior:
    scale = np.full((len(prior.mean.segments), 10), UNKNOWN_SPREAD)
    scale[:, 0] = 1.0 if keep_masses else UNKNOWN_SPREAD
    return replace(prior, covariance=prior.covariance * np.outer(scale, scale))
