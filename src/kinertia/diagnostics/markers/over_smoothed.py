"""Were markers smoothed so much that part of the motion is lost? A filter that is too strong leaves a tidy-looking
file.

A foot swings and lands fast, and the body moves up and down as the forces accelerate it. Both hold in fault-free files
of any laboratory: on 20 measured and synthetic walks and runs, 0.8 to 6 % of the energy of the feet's motion is above 4
Hz (0.4 % once filtered at 6 Hz, 0.02 % and less at 2 Hz), and forces move the body 0.8 to 1.05 times as fast as its
markers show.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np

from kinertia.diagnostics import needs
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.body_centre import bridged_trajectory
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import Markers

_QUICK_HZ, _LEAST_SHARE, _LEAST_SWING_M_S = Limit(4.0, "Hz"), Limit(0.002, usual=(0.008, 0.06)), 1.0
_CERTAIN_SHARE, _QUICK_OF_STANCE = Limit(0.0013), 3.1
"""Share that no fault-free motion has, of 30 (0.008 and more): after a filter at 3 Hz it is 0.0002 to 0.0012. Who
stands longer also swings more slowly: the limit of quick motion in Hz is at most the latter over the stance in s."""
_MOST_RATIO, _RATIO_OF_A_RATE = Limit(1.15, usual=(0.8, 1.05)), 1.8
_RIGID_M = 0.0115
"""Distances between markers of a shank change by up to 10 mm (median over pairs, 2 to 98 %). A filter shortens whatever
turns quickly; a wrong rate does not."""
_MOSTLY_SEEN = 0.9


@check("M133", unless=needs.VELOCITY, quick=_QUICK_HZ, share=_LEAST_SHARE, certain=_CERTAIN_SHARE, ratio=_MOST_RATIO)
def over_smoothed(context: RecordingContext) -> Iterator[Finding]:
    """Report M133: markers without the fast part of the motion that the forces show; no finding without steps."""
    trial, owners, changes = context.trial, context.segment_of_label, context.velocity_changes
    if trial is None or changes is None or not context.has_strides:
        return
    share = _quick_share(trial.markers, owners, _quick_hz(context))
    if share is None or share > _LEAST_SHARE:
        return
    ratio = min(changes.vertical_ratio(shown) or 0.0 for shown in (changes.pelvis, changes.centre))
    rigid = ratio > _RATIO_OF_A_RATE and _distances_change_m(trial.markers, owners) < _RIGID_M
    if (ratio >= _MOST_RATIO or share <= _CERTAIN_SHARE) and not rigid:
        yield finding(
            "M133",
            context.at(),
            share=Quantity(share, "1", limit=_LEAST_SHARE, usual=_LEAST_SHARE.usual),
            velocity_ratio=Quantity(ratio, "1", limit=_MOST_RATIO, usual=_MOST_RATIO.usual),
        )


def _quick_hz(context: RecordingContext) -> float:
    """Return the frequency above which motion is quick, lower for somebody whose steps last long."""
    stances = [one.end_s - one.start_s for one in context.contacts if one.is_step]
    return min(_QUICK_HZ, _QUICK_OF_STANCE / float(np.median(stances))) if stances else _QUICK_HZ


def _quick_share(markers: Markers, owners: Mapping[str, str], quick_hz: float) -> float | None:
    """Return the fast share of the energy of motion, median over swinging feet's markers; None where no foot swings."""
    shares = []
    for k, label in enumerate(markers.labels):
        seen = np.asarray(np.isfinite(markers.positions[:, k]).all(axis=1))
        if not owners.get(label, "").startswith("foot") or seen.mean() < _MOSTLY_SEEN:
            continue
        velocity = np.gradient(bridged_trajectory(markers.time, markers.positions[:, k]), markers.time, axis=0)
        velocity -= velocity.mean(axis=0)
        if np.quantile(np.linalg.norm(velocity, axis=1), 0.95) < _LEAST_SWING_M_S:
            continue
        power = np.square(np.abs(np.fft.rfft(velocity * np.hanning(len(velocity))[:, None], axis=0))).sum(axis=1)
        frequency = np.fft.rfftfreq(len(velocity), 1.0 / markers.rate_hz)
        shares.append(float(power[frequency > quick_hz].sum() / power.sum()))
    return float(np.median(shares)) if shares else None


def _distances_change_m(markers: Markers, owners: Mapping[str, str]) -> float:
    """Return how much (m) the distance of two markers of a shank changes, median of pairs; infinite without a pair."""
    ranges = []
    for side in "rl":
        own = [k for k, label in enumerate(markers.labels) if owners.get(label) == f"shank_{side}"]
        for one, other in combinations(own, 2):
            apart = np.linalg.norm(markers.positions[:, one] - markers.positions[:, other], axis=1)
            apart = apart[np.isfinite(apart)]
            ranges += [float(np.ptp(np.quantile(apart, (0.02, 0.98))))] if apart.size else []
    return float(np.median(ranges)) if ranges else np.inf
