"""Are the plates' zeros right, going by their unloaded readings?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.loaded_plates import STEP_N
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray
from kinertia.trial.unloaded_level import ZEROED_N, ZEROED_NM, UnloadedReading

_ZERO_N, _FAR_FROM_ZERO_N, _DRIFT_N = 15.0, 40.0, 15.0
"""For 70 kg, of whose weight 40 N are 6 %; zeroed plates read a few newtons."""
_LEAST_N = 6.0
"""Lowest limit, twice what zeroed plates read, however light the person."""
_MOST_UNLOADED_N, _STEADY_N = 150.0, 15.0
_UNLOADED_PERCENT = (2.0, 15.0)
"""Percentage of the record for which a plate that is walked over is at least unloaded."""
_UNKNOWN = UnloadedReading((np.nan, np.nan, np.nan), np.nan, 0.0, 0.0)


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
        level_n=Quantity(level_n, "N", limit=_limit_n(_ZERO_N, context.adult_share), usual=(-3.0, 3.0)),
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
