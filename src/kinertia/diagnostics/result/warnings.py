"""What a user should know before using the numbers of a fit: one sentence each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinertia.diagnostics.evidence.free_moment import mean_turning
from kinertia.diagnostics.result.common_gain import common_gain_warning
from kinertia.diagnostics.subject.force_mass import CARRIED_HINT, UNMEASURED_HINT, force_mass
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.estimation.input_checks import mass_by_force_kg
from kinertia.estimation.result import TrialFit
from kinertia.estimation.simultaneous.fit import CONTRADICTION_SD
from kinertia.estimation.simultaneous.instrument_warnings import GAIN, common
from kinertia.estimation.two_level import TwoLevelResult
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics

FORCE_MASS_TOLERANCE = 0.02
"""Scale and mean vertical force may differ by this share before a warning."""
MOTION_TOLERANCE = 0.05
"""Mass by the forces may differ by this share between the motion found and the markers' centre."""
ESTIMATE_TOLERANCE = 0.03
"""Scale and estimated total mass may differ by this share before a warning."""
LIGHTEST_LOAD_KG = 2.0
"""From which on a surplus may be something that was worn or carried."""
CONTRADICTING_COM_M = 0.1
"""A centre of mass this far from the literature contradicts it, if no prior says how far people's are: a trunk's is off
by 34 mm (SD)."""


def mass_from_force_kg(literature: BodySegmentParameters, trial: TrialFit) -> float:
    """Body mass by the vertical ground reaction of a fitted trial."""
    return mass_by_force_kg(literature, trial.kinematics.foot_loads, trial.residuals["literature"])


def force_warnings(
    carried: CarriedMass,
    literature: BodySegmentParameters,
    trials: Sequence[TrialFit],
    skeleton: Skeleton,
    calibration: Mapping[str, Mapping[str, float | str]] | None = None,
) -> list[str]:
    """Trials whose vertical force is not that of the person on the scale, or not that of the motion found.

    The first is said of the forces and the markers' centre alone (`force_mass`), so that no motion that we found
    wrongly can accuse the scale or the plates; of all trials at once where the estimate gives all plates the same gain.

    Args:
        carried: what was stated.
        literature, skeleton: as before the estimate.
        trials: as estimated.
        calibration: what the estimate found of the plates, if it looked.
    """
    warnings, measured = [], []
    mass_kg = carried.total_kg
    alike = bool(common(calibration or {}, GAIN))
    for trial in trials:
        by_markers = force_mass(skeleton, trial.kinematics.trial)
        if by_markers is None:
            continue
        by_force, by_motion = by_markers.mass_kg, mass_from_force_kg(literature, trial)
        if lost := by_markers.lost_for_a_while(carried):
            warnings.append(f"{trial.name}: the plates do not carry the stated {carried} all the time: {lost}")
        elif alike:
            measured.append(by_markers)
        elif abs(by_force - mass_kg) > FORCE_MASS_TOLERANCE * mass_kg + 2 * carried.sd_kg:
            check = "check the mass, and the gain and zero of the plates"
            check = f"{CARRIED_HINT}; else {check}" if by_force - mass_kg > LIGHTEST_LOAD_KG else check
            hint = f", {UNMEASURED_HINT}" if by_force < mass_kg else ""
            warnings.append(
                f"{trial.name}: the mean vertical force corresponds to {by_force:.1f} kg; stated mass {carried} "
                f"({100 * (by_force / mass_kg - 1):+.1f} %); {check}{hint}"
            )
        if abs(by_motion - by_force) > MOTION_TOLERANCE * by_force + 2 * by_markers.sd_kg:
            warnings.append(
                f"{trial.name}: before the estimate the motion does not go with the forces (they would move a body of "
                f"{by_motion:.1f} kg like this, and one of {by_force:.1f} kg like the markers): inverse kinematics "
                f"went wrong, not the plates; look at the marker errors over time for the frames where it did"
            )
    return [common_gain_warning(calibration or {}, measured, carried), *warnings] if alike else warnings


def fit_warnings(
    carried: CarriedMass,
    literature: BodySegmentParameters,
    estimate: BodySegmentParameters,
    source: str = "the literature",
    prior_sd: np.ndarray | None = None,
) -> list[str]:
    """What the user should know before using the parameters, whatever the estimator.

    `source` says where the parameters before the estimate come from, `prior_sd` (s, 10) how far people are from them.
    """
    warnings = []
    total, mass_kg = estimate.total_mass_kg, carried.total_kg
    if abs(total - mass_kg) > ESTIMATE_TOLERANCE * mass_kg + 2 * carried.sd_kg:
        warnings.append(
            f"the estimated total mass is {total:.1f} kg; stated mass {carried} "
            f"({100 * (total / mass_kg - 1):+.1f} %): the estimate follows the plates more than the scale"
        )
    moved = np.linalg.norm(estimate.com_m - literature.com_m, axis=1)
    if prior_sd is not None:
        apart = np.abs(estimate.com_m - literature.com_m)
        moved = np.where((apart > CONTRADICTION_SD * prior_sd[:, 1:4]).any(axis=1), moved, 0.0)
    worst = int(np.argmax(moved))
    if moved[worst] > CONTRADICTING_COM_M:
        warnings.append(
            f"the estimate contradicts {source}: the centre of mass of {estimate.segments[worst]} "
            f"moved by {moved[worst] * 1e3:.0f} mm"
        )
    return warnings


def turning_warnings(skeleton: Skeleton, trials: Sequence[Kinematics]) -> list[str]:
    """Trials whose mean vertical moment over whole strides is not near zero, and why that may be."""
    means = {}
    for k in trials:
        longest = max(k.stretches, key=lambda part: part.stop - part.start)
        centre = skeleton.root.centre(k.motion.q[longest])
        means[k.trial.name] = mean_turning(k.trial.loads, k.time[longest], centre)
    return [f"{name}: {mean.sentence()}" for name, mean in means.items() if mean is not None and mean.contradicts]


def two_level_warnings(result: TwoLevelResult) -> list[str]:
    """What the user should know of a two-level estimate: not converged, or physically impossible."""
    warnings = []
    if not result.converged:
        warnings.append(
            f"the two-level estimate did not converge within {result.evaluations} evaluations; the best iterate is "
            f"reported"
        )
    consistent = result.bsp.physically_consistent()
    if not consistent.all():
        names = [n for n, good in zip(result.bsp.segments, consistent, strict=True) if not good]
        warnings.append(
            f"the two-level estimate is physically impossible for {len(names)} of {len(consistent)} segments "
            f"({', '.join(names)}): it explains the forces, but skin motion decides single parameters; "
            f"do not use them as this person's"
        )
    return warnings
