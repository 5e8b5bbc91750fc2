"""Are the plates' zeros right, going by unloaded readings, and by horizontal forces that accelerate no body?

Forces integrated over time are the changes of the velocity of the centre of mass. On fault-free trials the trends of
the pelvis velocity and of the force-derived velocity agree within 8 N. A wrong zero of one plate acts whenever that
plate is loaded; an offset common to all plates is an unmeasured force, or markers and forces differ in the vertical
direction.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.body_motion import CLEARLY_BEST, HORIZONTAL, ForceVelocity, VelocityResidual
from kinertia.diagnostics.evidence.force_mass import ADULT_KG, STEP_N
from kinertia.diagnostics.runner import NEEDS_VELOCITY, NEEDS_VERTICAL_FORCE, check
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity
from kinertia.findings.rule import rule
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.ground_contact import FIRM_LOAD_N
from kinertia.trial.plate_signals import ZEROED_N, ZEROED_NM, UnloadedReading
from kinertia.trial.sampled_data import span_s, within

_ZERO_N = Limit(15.0, "N", usual=(-3.0, 3.0))
_FAR_FROM_ZERO_N, _DRIFT_N = Limit(40.0, "N"), Limit(15.0, "N")
"""For 70 kg, of whose weight 40 N are 6 %; zeroed plates read a few newtons."""
_LEAST_N = Limit(6.0, "N")
"""Lowest limit, twice what zeroed plates read, however light the person."""
_MOST_UNLOADED_N, _STEADY_N = 150.0, 15.0
_UNLOADED_PERCENT = (2.0, 15.0)
"""Percentage of the record for which a plate that is walked over is at least unloaded."""
_UNKNOWN = UnloadedReading((np.nan, np.nan, np.nan), np.nan, 0.0, 0.0)
_FORCE_N, _WINDOW_S = Limit(20.0, "N"), Limit(1.0, "s")
"""Mean over a window; over one that is shorter than this, pelvis and centre of mass part by as much
velocity in less time."""
_PLATE_ZERO_N, _LEAST_WINDOW_S, _LEAST_RESIDUAL_M_S = Limit(12.0, "N", usual=(-9.0, 9.0)), 0.75, 0.05
_ZEROED, _USUAL_RESIDUAL_M_S = 0.75, 0.105
"""Of 31 fault-free trials zeros of one plate are up to 9 N; a drift of 40 N over a trial makes 13 to 24 N, and without
it the residual is as on fault-free walks and runs."""
_AGREES = 0.5
"""Of the force that does not accelerate the body, what the unloaded plates' levels leave at most, if they are it."""


@check(
    "P211",
    "P213",
    "P216",
    unless=NEEDS_VERTICAL_FORCE,
    drift=_DRIFT_N,
    zero=_ZERO_N,
    far=_FAR_FROM_ZERO_N,
    least=_LEAST_N,
    adult=ADULT_KG,
)
def zeros(context: RecordingContext) -> Iterator[Finding]:
    """Report P211, P213 and P216: zero offsets of every plate and axis; limits in newtons apply to adults.

    Readers subtract a constant level from the loads (P216). A level that is not constant, or of plates stated to be
    zeroed, remains in the loads (P213).
    """
    plates, share = context.plates, context.adult_share
    if plates is None:
        return
    yield from unloaded_levels(context)
    for p, (name, unloaded) in enumerate(
        zip(plates.names, plates.unloaded or (_UNKNOWN,) * len(plates.names), strict=True)
    ):
        drifts = abs(unloaded.drift_n) > _limit_n(_DRIFT_N, share)
        if drifts:
            drift = Quantity(unloaded.drift_n, "N", limit=_limit_n(_DRIFT_N, share))
            yield finding("P211", context.at(plate=name, **context.along(1)), drift_n=drift)
        vertical = False
        for axis, level_n in enumerate(unloaded.remaining_n):
            if abs(level_n) > _limit_n(_ZERO_N, share) and not (drifts and axis == 1):
                far = axis == 1 and abs(level_n) > _FAR_FROM_ZERO_N * share
                vertical |= axis == 1
                yield _zero(context, name, axis, level_n, "unloaded blocks", Severity.ERROR if far else None)
        least_n = None if drifts or vertical else _steady_minimum(plates.force[:, p, 1], share)
        if least_n is not None:
            yield _zero(context, name, 1, least_n, "minimum", Severity.ERROR)


@check("P216", level=Limit(ZEROED_N, "N"), moment=Limit(ZEROED_NM, "N m"))
def unloaded_levels(context: RecordingContext) -> Iterator[Finding]:
    """Report P216: the unloaded reading of a plate in use, which has been subtracted from its loads."""
    plates = context.plates
    for p, unloaded in enumerate(() if plates is None else plates.unloaded or ()):
        assert plates is not None
        if not unloaded.subtracted or not plates.force[:, p].any():
            continue
        axis = int(np.argmax(np.abs(unloaded.level_n)))
        yield finding(
            "P216",
            context.at(plate=plates.names[p], **context.along(axis)),
            level_n=Quantity(unloaded.level_n[axis], "N", limit=ZEROED_N, usual=(-ZEROED_N, ZEROED_N)),
            moment_nm=Quantity(unloaded.twist_nm, "N m", limit=ZEROED_NM),
            levels_n=Quantity(unloaded.level_n, "N"),
        )


def _limit_n(adult_n: float, share: float) -> float:
    return max(_LEAST_N, adult_n * share)


def _zero(
    context: RecordingContext, name: str, axis: int, level_n: float, method: str, severity: Severity | None
) -> Finding:
    return finding(
        "P213",
        context.at(plate=name, **context.along(axis)),
        severity,
        level_n=Quantity(level_n, "N", limit=_limit_n(_ZERO_N, context.adult_share), usual=_ZERO_N.usual),
        method=Quantity(method),
    )


def _steady_minimum(vertical: FloatArray, share: float) -> float | None:
    """Return the small steady force (N) of a plate that was walked over, where the others show none; None without one.

    It counts as a load, so that no contact on that plate begins or ends.
    """
    if not len(vertical):
        return None
    low, high = np.percentile(vertical, _UNLOADED_PERCENT)
    small = low > LOAD_THRESHOLD_N and high < _MOST_UNLOADED_N * share
    if vertical.max() > STEP_N * share and small and high - low < _STEADY_N:
        return float(low + high) / 2
    return None


@check("P212", "P214", unless=NEEDS_VELOCITY, of_one=_PLATE_ZERO_N, force=_FORCE_N, window=_WINDOW_S)
def zeros_under_load(context: RecordingContext) -> Iterator[Finding]:
    """Report P212 and P214: zero offsets under load along each horizontal axis.

    Their limits are the same for children: in six children of 25 to 60 kg who walk straight and turn, up to 27 N seem
    not to accelerate the pelvis, in windows below 1 s, and zeros of one plate seem to be up to 11 N.
    """
    parts, plates = context.velocities, context.plates
    if plates is None or not parts:
        return
    for axis in HORIZONTAL:
        unexplained = _unexplained(context, plates, parts, axis)
        zero = _plate_zero(context, plates, parts, axis, unexplained is not None)
        yield from (reported for reported in (zero, unexplained) if reported is not None)


def _unexplained(
    context: RecordingContext, plates: PlateLoads, parts: Sequence[ForceVelocity], axis: int
) -> Finding | None:
    """Report P214: the trend of the force-derived velocity beyond the pelvis', as a force; longer windows count more.

    Without strides the trunk bends, so that the pelvis moves differently: the marker-based centre must agree.
    """
    spans = np.array([np.ptp(part.time) for part in parts])
    force_n = _trend_n([part.pelvis for part in parts], parts, axis)
    if not context.has_strides:
        by_centre_n = _trend_n([part.centre for part in parts], parts, axis)
        force_n = min(force_n, by_centre_n, key=abs) if force_n * by_centre_n > 0.0 else 0.0
    limit_n = _FORCE_N * max(1.0, _WINDOW_S / float(spans.max()))
    if abs(force_n) <= limit_n:
        return None
    weight_n = GRAVITY_M_S2 * float(np.mean([part.mass_kg for part in parts]))
    evidence = {
        "force_n": Quantity(force_n, "N", limit=limit_n, usual=(-8.0, 8.0)),
        "tilt_rad": Quantity(float(np.arctan(force_n / weight_n)), "rad"),
    }
    levels, causes = _levels(plates, axis), rule("P214").causes
    if levels is not None:
        evidence["unloaded_n"] = Quantity(tuple(levels.tolist()), "N")
        shares = [
            (plates.force[within(plates.time, *part.time[[0, -1]]), :, 1] > 0.0).mean(axis=0) @ levels for part in parts
        ]
        agree = abs(force_n - float(np.average(shares, weights=spans**3))) < _AGREES * abs(force_n)
        causes = tuple(sorted(causes, key=lambda cause: ("P213" in cause) != agree))
    return with_evidence("P214", context.at(**context.along(axis)), evidence, causes=causes)


def _trend_n(shown: Sequence[FloatArray], parts: Sequence[ForceVelocity], axis: int) -> float:
    """Return the force (N) by which the forces change the body's velocity more than shown (n, 3) m/s in each window."""
    trends = [
        part.mass_kg * np.polyfit(part.time - part.time.mean(), part.by_forces[:, axis] - velocity[:, axis], 1)[0]
        for velocity, part in zip(shown, parts, strict=True)
    ]
    return float(np.average(trends, weights=[np.ptp(part.time) ** 3 for part in parts]))


def _levels(plates: PlateLoads, axis: int) -> FloatArray | None:
    """Return the forces (p,) N that unloaded plates read along an axis and that are still in their loads; None unless
    known for each plate.
    """
    levels = np.array([unloaded.remaining_n[axis] for unloaded in plates.unloaded or ()])
    return levels if levels.size and np.isfinite(levels).all() else None


def _plate_zero(
    context: RecordingContext, plates: PlateLoads, parts: Sequence[ForceVelocity], axis: int, all_plates: bool
) -> Finding | None:
    """Report P212: a force of one loaded plate that does not accelerate the body, unless all plates show it as well, or
    there are no strides: the body's horizontal velocity is then less certain.
    """
    long = [part for part in parts if span_s(part.time) >= _LEAST_WINDOW_S]
    if not long or not context.has_strides:
        return None
    residual = VelocityResidual.of(plates.time, plates.force, long, axis)
    best = int(np.argmin(residual.plate_zeroed))
    zero_offset_n, zeroed = float(residual.zero_offset_n[best]), float(residual.plate_zeroed[best])
    limit_m_s = min(_ZEROED * residual.as_read, _USUAL_RESIDUAL_M_S)
    if residual.as_read < _LEAST_RESIDUAL_M_S or zeroed > limit_m_s:
        return None
    limit_n = _PLATE_ZERO_N * max(1.0, _WINDOW_S / max(span_s(part.time) for part in long))
    if abs(zero_offset_n) < limit_n or min(scaling.residual for scaling in residual.scaled) < CLEARLY_BEST * zeroed:
        return None
    names = [plates.names[p] for p in np.flatnonzero(residual.plate_zeroed * CLEARLY_BEST < zeroed)]
    if all_plates and not (len(names) == 1 and zeroed < CLEARLY_BEST * residual.without_trend):
        return None
    vertical_n = plates.force[:, best, 1]
    share = zero_offset_n / float(vertical_n[vertical_n > FIRM_LOAD_N].mean())
    evidence = {
        "offset_n": Quantity(zero_offset_n, "N", limit=limit_n, usual=_PLATE_ZERO_N.usual),
        "share": Quantity(share, "1"),
        "velocity_residual_m_s": residual.evidence(zeroed, limit_m_s),
    }
    levels, causes = _levels(plates, axis), rule("P212").causes
    if levels is not None:
        evidence["unloaded_n"] = Quantity(float(levels[best]), "N")
        # an amplifier's zero is the same unloaded
        causes = causes if abs(levels[best] - zero_offset_n) < _AGREES * abs(zero_offset_n) else causes[::-1]
    if len(names) > 1:
        evidence["plate"] = Quantity(" or ".join(names))
    place = context.at(plate=names[0] if len(names) == 1 else None, **context.along(axis))
    return with_evidence("P212", place, evidence, causes=causes)
