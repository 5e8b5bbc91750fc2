"""Are the labels of a trial right? Finds markers that were given each other's names, by trying the exchange.

Swapped markers pull the model away, so that the largest error need not be theirs, and the model that fits best may be
far from the truth (a foot turned round). What gives them away is that everything falls into place once they are
exchanged.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from kinertia.errors import TrialError
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.trial.data import Markers

_FRAMES = 3
_ENOUGH_M2 = 1e-6
"""Errors of centimetres are compared: fits that would gain less than the square of a millimetre may stop."""
_MOST_STEPS = 8
"""The right exchange falls into place in a few steps (on measured walks with four); what takes more is none."""
_SUSPECT_M = 0.025
"""Markers that the static model misses by less than this are not doubted."""
_MOST_SUSPECTS = 8
_CURED = 0.55
"""Two markers were swapped if exchanging them brings their errors below this share of what they were."""
_LOST_M = 0.08
"""The static model fits the trial not at all if it misses the markers by more than this (root mean square)."""


def check_labels(skeleton: Skeleton, name: str, markers: Markers) -> None:
    """Raise TrialError when two markers look swapped, or the model cannot follow the markers at all.

    Every two of the markers with the largest errors are exchanged in turn. Markers close together on a part that can
    turn freely (both wrist markers) cannot be told apart; exchanging them does no harm.

    Args:
        skeleton: the static model, with free arm rotations.
        name: the trial's, for the message.
        markers: the trial's, or a few frames of them.
    """
    skeleton, measured, errors = _complete_frames(skeleton, name, markers)
    labels, plain = measured.labels, _typical(errors)
    suspects = [k for k in np.argsort(-plain)[:_MOST_SUSPECTS] if plain[k] > _SUSPECT_M]
    pairs = np.array(list(combinations(sorted(suspects), 2)), dtype=int).reshape(-1, 2)
    trials = np.repeat(measured.positions[None], len(pairs), axis=0)
    for trial, pair in zip(trials, pairs, strict=True):
        trial[:, pair] = trial[:, pair[::-1]]
    exchanged = _exchanged_errors(skeleton, labels, trials)
    # the exchanged markers' errors under each other's names
    before = np.sqrt(np.square(plain[pairs]).mean(axis=1))
    after = np.sqrt(np.square(np.take_along_axis(exchanged, pairs, axis=1)).mean(axis=1))
    gain = np.square(plain).sum() - np.square(exchanged).sum(axis=1)
    cured = (after < _CURED * before) & (gain > before**2 - after**2)
    if cured.any():
        best = int(np.argmax(np.where(cured, gain, -np.inf)))
        first, second = (labels[k] for k in pairs[best])
        raise TrialError(
            name,
            f"the markers '{first}' and '{second}' look swapped: the model of the static trial misses them by "
            f"{before[best] * 1e3:.0f} mm, and by {after[best] * 1e3:.0f} mm once exchanged; correct the labels",
        )
    overall = float(np.sqrt(np.square(plain).mean()))
    if overall > _LOST_M:
        listed = ", ".join(f"'{labels[k]}' ({plain[k] * 1e3:.0f} mm)" for k in np.argsort(-plain)[:3])
        raise TrialError(
            name,
            f"the model of the static trial misses the markers by {overall * 1e3:.0f} mm RMS, most of all {listed}; "
            f"check labels, units, and that both trials show the same person",
        )


def _complete_frames(skeleton: Skeleton, name: str, markers: Markers) -> tuple[Skeleton, Markers, np.ndarray]:
    """The skeleton without coordinates that the trial never shows, a few frames of its markers, and their errors (f, m)
    from the model that fits best.
    """
    ik = solve_ik(skeleton, markers, name, consecutive=False, gain_tolerance_m2=_ENOUGH_M2)
    known = np.isfinite(ik.q)
    never = [c for c, shown in zip(ik.coordinates, known.any(axis=0), strict=True) if not shown]
    known = known[:, known.any(axis=0)]
    solved = np.flatnonzero(known.all(axis=1))
    if not solved.size:
        names = [c for c in ik.coordinates if c not in never]
        rare = ", ".join(names[c] for c in np.argsort(known.sum(axis=0))[:3])
        raise TrialError(
            name,
            f"in none of the {len(known)} frames looked at are enough markers visible for all coordinates (rarest: "
            f"{rare}); fill the gaps of the markers or use another trial",
        )
    some = solved[np.unique(np.linspace(0, len(solved) - 1, _FRAMES).round().astype(int))]
    measured = markers.select(ik.labels)
    few = Markers(measured.time[some], ik.labels, measured.positions[some])
    return skeleton.lock(dict.fromkeys(never, 0.0)), few, ik.errors_m[some]


def _exchanged_errors(skeleton: Skeleton, labels: tuple[str, ...], measured: np.ndarray) -> np.ndarray:
    """(h, m) m, `_typical` distance of each marker from the model that fits best, for h versions (h, f, m, 3)."""
    if not len(measured):
        return np.zeros((0, len(labels)))
    frames = measured.reshape(-1, *measured.shape[2:])
    unrelated = Markers(np.arange(len(frames), dtype=float), labels, frames)
    ik = solve_ik(skeleton, unrelated, consecutive=False, gain_tolerance_m2=_ENOUGH_M2, most_steps=_MOST_STEPS)
    return _typical(ik.errors_m.reshape(measured.shape[:3]))


def _typical(errors: np.ndarray) -> np.ndarray:
    """(..., m) of errors (..., f, m): the median over the frames, 0 for a marker that is not seen.

    The fit starts from the upright pose and may be lost in one of them.
    """
    seen = np.isfinite(errors).any(axis=-2)
    return np.where(seen, np.nanmedian(np.where(seen[..., None, :], errors, 0.0), axis=-2), 0.0)
