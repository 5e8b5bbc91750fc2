"""R30, may the result be used? Residuals and markers by OpenSim's guideline, and joint angles by ranges of motion.

The guideline for residual reduction ("Simulation with OpenSim - Best Practices" and Hicks et al. 2015, J Biomech Eng
137:020905) also wants the peak force below 5 % of the largest external force. OpenSim judges each axis on its own; here
it is the length of the vector, as in `fit.json`, which is stricter. Residuals with forces at the motion's bandwidth are
judged, since no motion of the model can follow faster forces. Residuals with forces at full bandwidth, which OpenSim's
tools find, are reported with them; if only these exceed the guideline, the finding is an INFO.

A residual force that is acceptable by the guideline, but not good, is a WARNING only if the joint moments may be wrong
by what matters clinically: 0.17 N m/kg, the smallest detectable change of a person's knee adduction moment (1.0 % of
body weight times height; from the standard error of measurement by Birmingham et al. 2007, Arthritis Rheum 57:1012).
Synthetic walks whose plates read random forces below 3 Hz that are not there, the worst case: all of it is an error of
the moments, stay below this in 95 % of the frames up to a residual of 0.11 N RMS per kg (0.12 to 0.16 N m/kg at 0.074
to 0.086 N/kg, 0.17 to 0.19 at 0.12 to 0.14). Error bars do not include such forces: they hold 73 to 83 % there.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.runner import check
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.anatomy import segment_of
from kinertia.model.coordinate_range import TOLERANCE_DEG, UNKNOWN
from kinertia.model.neutral_joints import centre_offsets
from kinertia.trial.sampled_data import rms, rms_by_marker

_IMPOSSIBLE_RAD = Limit(np.radians(TOLERANCE_DEG), "rad")
"""Excess beyond the range of any person."""
_SURE = 2.0
"""SDs of an estimated angle."""


def _limits(unit: str, rms_: float, peak: float) -> tuple[Limit, Limit]:
    return Limit(rms_, unit, source=_GUIDELINE), Limit(peak, unit, source=_GUIDELINE)


class Guideline(NamedTuple):
    """OpenSim's limits of RMS and peak: an ERROR beyond `acceptable`, an INFO or WARNING beyond `good`."""

    code: str
    unit: str
    good: tuple[Limit, Limit]
    acceptable: tuple[Limit, Limit]


_GUIDELINE = "OpenSim's guideline (Hicks et al. 2015)"
FORCE = Guideline("R301", "N", _limits("N", 5.0, 10.0), _limits("N", 10.0, 25.0))
MOMENT = Guideline("R302", "N m", _limits("N m", 30.0, 50.0), _limits("N m", 50.0, 75.0))
HARMLESS_N_PER_KG = Limit(0.11, "N")
"""RMS residual force per body mass up to which joint moments are right within what matters clinically."""
PEAK_FORCE_SHARE = Limit(0.05, source=_GUIDELINE)
"""Largest share of the peak external force that the peak residual force may have."""
GOOD_MARKERS_M, ACCEPTABLE_MARKERS_M = Limit(0.012, "m"), Limit(0.020, "m", source=_GUIDELINE)
"""RMS distance of the markers: OpenSim's guideline for inverse kinematics is 20 mm."""
_LEGS = ("pelvis", "thigh", "shank", "foot")
_WORST_MARKERS = 3
_WRONG_MODEL_M = 0.045
"""RMS distance that markers of a fault-free model exceed on no person, wherever they are attached."""


@check(
    "R301",
    "R302",
    "R303",
    "R304",
    rms_force=FORCE.good[0],
    peak_force=FORCE.good[1],
    acceptable_rms_force=FORCE.acceptable[0],
    acceptable_peak_force=FORCE.acceptable[1],
    harmless=HARMLESS_N_PER_KG,
    rms_moment=MOMENT.good[0],
    peak_moment=MOMENT.good[1],
    acceptable_rms_moment=MOMENT.acceptable[0],
    acceptable_peak_moment=MOMENT.acceptable[1],
    share=PEAK_FORCE_SHARE,
    markers=GOOD_MARKERS_M,
    acceptable_markers=ACCEPTABLE_MARKERS_M,
)
def residuals(context: ResultContext) -> Iterator[Finding]:
    """Check the residual force and moment of every trial, and the distance of its markers."""
    for trial in context.fit.trials:
        yield from residuals_of(trial, context.fit.mass_kg)
        yield from _markers(context, trial)


def residuals_of(trial: TrialFit, mass_kg: float) -> Iterator[Finding]:
    """Report R301, R302 and R303: residual forces and moments of one trial of a body of this mass."""
    if not trial.kinematics.complete:
        return
    narrow, full = (_lengths(each["estimate"]) for each in (trial.residuals, trial.full_residuals))
    for guideline, judged, whole in zip((FORCE, MOMENT), narrow, full, strict=True):
        harmless = guideline is FORCE and rms(judged) <= HARMLESS_N_PER_KG * mass_kg
        yield from _by_guideline(trial, guideline, judged, whole, harmless)
    external_n = float(np.linalg.norm(trial.kinematics.foot_loads[:, :, :3].sum(axis=1), axis=1).max())
    share = float(narrow[0].max()) / external_n
    if share > PEAK_FORCE_SHARE:
        evidence = Quantity(share, "1", limit=PEAK_FORCE_SHARE), Quantity(external_n, "N")
        yield finding("R303", Where(trial=trial.name), share=evidence[0], external_n=evidence[1])


def _lengths(residual: np.ndarray) -> list[np.ndarray]:
    """Return lengths (w,) of force and moment of a residual (w, 6)."""
    return [np.linalg.norm(part, axis=1) for part in np.hsplit(residual, 2)]


def _by_guideline(
    trial: TrialFit, guideline: Guideline, judged: np.ndarray, whole: np.ndarray, harmless: bool
) -> Iterator[Finding]:
    """Check vector lengths (w,) at the bandwidths of motion and forces against a guideline; what is acceptable by it is
    an INFO where it is harmless.
    """
    code, unit, good, acceptable = guideline
    typical, peak = rms(judged), float(judged.max())
    suffix = unit.replace(" ", "").lower()
    evidence = {
        f"rms_{suffix}": Quantity(typical, unit, limit=good[0]),
        f"peak_{suffix}": Quantity(peak, unit, limit=good[1]),
        f"full_rms_{suffix}": Quantity(rms(whole), unit),
        f"full_peak_{suffix}": Quantity(float(whole.max()), unit),
        "motion_hz": Quantity(trial.motion_hz, "Hz"),
    }

    def beyond(limits: tuple[float, float], typical: float = typical, peak: float = peak) -> bool:
        return typical > limits[0] or peak > limits[1]

    if beyond(acceptable):
        severity = Severity.ERROR
    elif beyond(good) and not harmless:
        severity = Severity.WARNING
    elif beyond(good) or beyond(good, rms(whole), float(whole.max())):
        severity = Severity.INFO
    else:
        return
    yield with_evidence(code, Where(trial=trial.name), evidence, severity)


def _markers(context: ResultContext, trial: TrialFit) -> Iterator[Finding]:
    """Report R304: markers far from the model. Calibrating hides gross errors, and helps no further once it has been
    done.

    Arms and trunk move in ways that the model's shoulders cannot follow, so only markers of pelvis and legs can cause
    an ERROR.
    """
    errors_m, labels = trial.marker_errors_m["final"], trial.kinematics.ik.labels
    segments = {marker.label: str(segment_of(marker.segment)) for marker in trial.skeleton.markers}
    of_legs = np.array([segments[label].startswith(_LEGS) for label in labels])
    apart_m = rms(errors_m)
    legs_m = rms(errors_m[:, of_legs]) if of_legs.any() else apart_m
    if apart_m <= GOOD_MARKERS_M:
        return
    worst = np.argsort(-np.nan_to_num(rms_by_marker(errors_m)))[:_WORST_MARKERS]
    far = "Joint angles" if legs_m > GOOD_MARKERS_M else "Joint angles of trunk and arms"
    wrong = apart_m > _WRONG_MODEL_M or bool(centre_offsets(context.fit.skeleton))
    calibrate = context.fit.file is not None and not wrong
    check = "check that the model was scaled to this person, and all labels"
    advice = "let markers and joint centres move (--calibrate)" if calibrate else check
    yield finding(
        "R304",
        Where(trial=trial.name, markers=tuple(labels[i] for i in worst)),
        Severity.ERROR if legs_m > ACCEPTABLE_MARKERS_M else None,
        rms_m=Quantity(apart_m, "m", limit=GOOD_MARKERS_M),
        legs_m=Quantity(legs_m, "m", limit=ACCEPTABLE_MARKERS_M),
        angles=Quantity(far),
        advice=Quantity(advice[0].upper() + advice[1:]),
    )


@check("R305", impossible=_IMPOSSIBLE_RAD)
def joint_angles(context: ResultContext) -> Iterator[Finding]:
    """Report R305: every coordinate that leaves its range in a trial, with its most extreme angle.

    Angles beyond the range by less than two of their own SDs are not reported.
    """
    for trial in context.fit.trials:
        for column, name in enumerate(trial.kinematics.ik.coordinates):
            known = trial.skeleton.ranges.get(name, UNKNOWN).anatomical(name)
            if known is None:
                continue
            low, high = known.of_anybody
            angles = trial.motion.q[:, column]
            beyond = np.maximum(low - angles, angles - high)
            worst = int(np.argmax(beyond))
            sd = 0.0 if trial.deviations is None else float(trial.deviations.coordinates[worst, column])
            if beyond[worst] > min(_SURE * sd, _IMPOSSIBLE_RAD):
                yield finding(
                    "R305",
                    Where(trial=trial.name, part=name),
                    Severity.ERROR if beyond[worst] > _IMPOSSIBLE_RAD else None,
                    angle_rad=Quantity(float(angles[worst]), "rad", sd=sd),
                    range_rad=Quantity((low, high), "rad"),
                )
