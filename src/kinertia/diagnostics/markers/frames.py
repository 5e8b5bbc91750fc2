"""M12: are all frames measured frames, and enough of them? Missing, copied, interpolated and too few ones.

On 17 measured recordings of motions and ten synthetic ones no frame repeats the one before it, hardly any lies midway
between its neighbours, and the median marker's step (`trajectory_faults`) is at most 1.5 mm.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics import needs
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import (
    COPIED_SHARE,
    FEWEST_FRAMES,
    LEAST_MOTION_M,
    CopiedFrames,
    brief_runs,
    slowness,
    steps,
    without_copied_frames,
)
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.sampled_data import runs

_MISSING_M, _MISSING_TIMES = Limit(0.006, "m", usual=(0.0, 0.0015)), Limit(3.0)
"""Step of the median marker where frames are missing: at least this distance, and this multiple of its usual step.
Noisy cameras move all markers, in every frame."""
_FEW_COPIED = Limit(0.05)
"""Share of the frames up to which copies of dropped frames are treated as gaps (`without_copied_frames`)."""
_INTERPOLATED_SHARE, _STRAIGHT = Limit(0.4), 0.03
"""Of three frames drawn between two measured ones all lie in the middle between their neighbours: they bend by less
than this share of how much the quick frames bend."""

_LEAST_RATE_HZ = Limit(45.0, "Hz", usual=(60.0, 250.0))
"""With frames of five walks left out, joint moments changed by .1 to .9 SDs at 50 Hz, but for one (3.1), and by up to
3.8 SDs at 30 Hz."""


@check(
    "M121",
    "M122",
    "M123",
    "M124",
    unless=needs.LENGTH_UNIT,
    step=_MISSING_M,
    times=_MISSING_TIMES,
    few=_FEW_COPIED,
    copied=COPIED_SHARE,
    interpolated=_INTERPOLATED_SHARE,
    rate=_LEAST_RATE_HZ,
)
def frames(context: RecordingContext) -> Iterator[Finding]:
    """Report M121 to M124: missing frames (one finding per cut), copied frames, interpolated frames, too few frames."""
    markers = context.markers
    if markers.rate_hz < _LEAST_RATE_HZ:
        rate = Quantity(markers.rate_hz, "Hz", limit=_LEAST_RATE_HZ, usual=_LEAST_RATE_HZ.usual)
        yield finding("M124", context.at(), rate_hz=rate)
    if len(markers.time) < FEWEST_FRAMES:
        return
    copies = CopiedFrames.of(markers)
    if upsampled := _upsampled(context, copies):
        yield upsampled
        return
    if copies.fill_lost_frames:
        yield _copied(context, copies)
    yield from _missing(context)


def _upsampled(context: RecordingContext, copies: CopiedFrames) -> Finding | None:
    markers = context.markers
    interpolated = float(brief_runs(_between(markers.positions), markers.rate_hz).mean())
    if copies.share > COPIED_SHARE:
        share, limit, method = copies.share, COPIED_SHARE, "held"
    elif interpolated > _INTERPOLATED_SHARE and not copies.fill_lost_frames:
        share, limit, method = interpolated, _INTERPOLATED_SHARE, "interpolated"
    else:
        return None
    return finding(
        "M123",
        context.at(),
        share=Quantity(share, "1", limit=limit, usual=(0.0, 0.0)),
        true_rate_hz=Quantity(markers.rate_hz * (1.0 - share), "Hz"),
        rate_hz=Quantity(markers.rate_hz, "Hz"),
        method=Quantity(method),
    )


def _copied(context: RecordingContext, copies: CopiedFrames) -> Finding:
    time = context.markers.time[copies.copied]
    few = copies.share <= _FEW_COPIED and not copies.insertions
    return finding(
        "M122",
        context.at(span_s=(float(time[0]), float(time[-1]))),
        Severity.WARNING if few else None,
        frames=Quantity(float(len(time)), "1", usual=(0.0, 0.0)),
        share=Quantity(copies.share, "1", limit=_FEW_COPIED),
        inserted=Quantity(float(copies.insertions), "1"),
        first_s=Quantity(float(time[0]), "s"),
    )


def _missing(context: RecordingContext) -> Iterator[Finding]:
    """Find cuts where most markers step at once, up to the last load: frames missing before it delay the forces."""
    markers = without_copied_frames(context.markers)
    if context.contact_span_s is not None:
        markers = markers.cut(markers.time[0], context.contact_span_s[1])
    if len(markers.time) < FEWEST_FRAMES:
        return
    step = _median_step_m(markers)
    shown = np.isfinite(step)
    usually = float(np.median(step[shown])) if shown.any() else 0.0
    limit = max(_MISSING_M * slowness(markers.rate_hz), _MISSING_TIMES * usually)
    beyond = np.nan_to_num(step) > limit
    # a cut makes the steps before and after it look half as large
    near = np.pad(beyond, 1)
    for first, last in runs(beyond | near[2:] | near[:-2]):
        cut = first + int(np.nanargmax(step[first : last + 1]))
        span = (float(markers.time[cut + 1]), float(markers.time[cut + 2]))
        yield finding(
            "M121",
            context.at(span_s=span),
            step_m=Quantity(float(step[cut]), "m", limit=limit, usual=_MISSING_M.usual),
            frames=Quantity(float(_frames_lost(markers, cut)), "1"),
            time_s=Quantity(span[1], "s"),
        )


def _median_step_m(markers: Markers) -> FloatArray:
    """Return the step (n - 3,) m of the median marker; NaN where half of the markers are not visible."""
    size = np.linalg.norm(steps(markers.positions), axis=-1)
    shown = np.isfinite(size).sum(axis=1) > 0.5 * len(markers.labels)
    median = np.full(len(size), np.nan)
    median[shown] = np.nanmedian(size[shown], axis=1)
    return median


def _frames_lost(markers: Markers, cut: int) -> int:
    """Return the number of missing frames, from how far markers move across a cut and next to it."""
    went = np.linalg.norm(np.diff(markers.positions, axis=0), axis=-1)
    usual = float(np.nanmedian(np.concatenate([went[cut : cut + 1], went[cut + 2 : cut + 3]])))
    return max(1, round(float(np.nanmedian(went[cut + 1])) / max(usual, 1e-4)) - 1)


def _between(position: FloatArray) -> BoolArray:
    """Find frames (n - 2,) in which most markers are midway between their neighbours, unless they are in all frames."""
    bend = np.linalg.norm(np.diff(position, n=2, axis=0), axis=2)
    shown = np.isfinite(bend).any(axis=1)
    went = np.linalg.norm(np.diff(position, axis=0), axis=2)
    if not shown.any() or not np.nanmedian(went) > LEAST_MOTION_M:
        return np.zeros(len(bend), dtype=bool)
    typical = np.full(len(bend), np.nan)
    typical[shown] = np.nanmedian(bend[shown], axis=1)
    quick = float(np.nanquantile(typical, 0.95))
    return np.asarray(shown & (np.nan_to_num(typical, nan=np.inf) < _STRAIGHT * quick))
