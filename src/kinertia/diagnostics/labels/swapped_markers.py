"""Finds swapped labels by trying each swap with the model of the static trial: L212 and R106.

Swapped markers pull the model away, so they need not have the largest errors, and the best fit may be far from the
truth (a foot turned round). They are recognised by how well everything fits once they are swapped back.
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from kinertia.diagnostics import needs
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import step_limit_m, steps
from kinertia.diagnostics.runner import check
from kinertia.estimation.prepare.calibration import sampled
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.gait27 import ARM_ROTATIONS, ELBOWS
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.trial.data import Markers, Recording, Trial

_FRAMES = 3
_ENOUGH_M2 = 1e-6
"""Errors of centimetres are compared: fits that would gain less than the square of a millimetre may stop."""
_MOST_STEPS = 8
"""The right swap falls into place in a few steps (on measured walks with four); what takes more is none."""
_SUSPECT_M = 0.025
"""Markers that the static model misses by less than this are not doubted."""
_MOST_SUSPECTS = 8
_RESOLVED_SHARE = 0.55
"""Two labels were swapped if swapping them back brings their errors below this share of what they were."""
_FEWEST_TO_TURN = 2
LOST_M = Limit(0.08, "m")
"""The static model fits the trial not at all if it misses the markers by more than this (root mean square)."""


def labels_by_model(skeleton: Skeleton, trial: Trial | Recording) -> Iterator[Finding]:
    """Report L212: two labels look swapped; else R106: the model cannot follow the markers at all; or R103: no frame
    shows enough of them.

    Every two of the markers with the largest errors are swapped in turn. Markers close together on a part that can
    turn freely (both wrist markers) cannot be distinguished; swapping them does no harm.

    Args:
        skeleton: the model of the static trial.
        trial: a few of its frames are looked at.
    """
    where = Where(trial=trial.name)
    frames = _complete_frames(skeleton, trial.name, sampled(trial.markers))
    if isinstance(frames, Finding):
        yield frames
        return
    model, measured, errors = frames
    labels, plain = measured.labels, _typical(errors)
    suspects = [k for k in np.argsort(-plain)[:_MOST_SUSPECTS] if plain[k] > _SUSPECT_M]
    pairs = np.array(list(combinations(sorted(suspects), 2)), dtype=int).reshape(-1, 2)
    versions = np.repeat(measured.positions[None], len(pairs), axis=0)
    for version, pair in zip(versions, pairs, strict=True):
        version[:, pair] = version[:, pair[::-1]]
    swapped = _swapped_errors(model, labels, versions)
    # the swapped markers' errors under each other's names
    before = np.sqrt(np.square(plain[pairs]).mean(axis=1))
    after = np.sqrt(np.square(np.take_along_axis(swapped, pairs, axis=1)).mean(axis=1))
    gain = np.square(plain).sum() - np.square(swapped).sum(axis=1)
    resolved = (after < _RESOLVED_SHARE * before) & (gain > before**2 - after**2)
    overall = float(np.sqrt(np.square(plain).mean()))
    if resolved.any():
        best = int(np.argmax(np.where(resolved, gain, -np.inf)))
        yield finding(
            "L212",
            Where(trial=trial.name, markers=tuple(labels[k] for k in pairs[best])),
            before_m=Quantity(float(before[best]), "m", limit=_SUSPECT_M),
            after_m=Quantity(float(after[best]), "m", limit=_RESOLVED_SHARE * float(before[best])),
            method=Quantity("model fit"),
            reference=Quantity("static trial"),
        )
    elif overall > LOST_M:
        worst = ", ".join(labels[k] for k in np.argsort(-plain)[:3])
        yield finding("R106", where, rms_m=Quantity(overall, "m", limit=LOST_M), worst=Quantity(worst))


def _complete_frames(skeleton: Skeleton, name: str, markers: Markers) -> tuple[Skeleton, Markers, np.ndarray] | Finding:
    """Return a skeleton whose arms turn about their own axes, without coordinates that the trial never shows, with a
    few frames of its markers and their errors (f, m) from the best fit; R103 of the rarest coordinate where no frame
    shows all.

    Frames with a straight elbow do not show how the arm has rotated about its own axis, nor need they; the bending
    direction of an elbow does not matter here. A single marker shows where an arm points, as long as the arm does not
    rotate.
    """
    free = [name for name in ARM_ROTATIONS if _arm_markers(skeleton, markers, name[-1]) >= _FEWEST_TO_TURN]
    model = skeleton.unbounded(ELBOWS).free(free)
    ik = solve_ik(model, markers, name, consecutive=False, gain_tolerance_m2=_ENOUGH_M2)
    known = np.isfinite(ik.q)
    never = [c for c, shown in zip(ik.coordinates, known.any(axis=0), strict=True) if not shown]
    needed = [c for c in skeleton.coordinates if c not in never]
    known = known[:, [ik.coordinates.index(c) for c in needed]]
    solved = np.flatnonzero(known.all(axis=1))
    if not solved.size:
        rare = needed[int(np.argmin(known.sum(axis=0)))]
        frames = Quantity(float(known.sum(axis=0).min()), "1")
        return finding("R103", Where(trial=name, part=rare), frames=frames)
    some = solved[np.unique(np.linspace(0, len(solved) - 1, _FRAMES).round().astype(int))]
    measured = markers.select(ik.labels)
    few = Markers(measured.time[some], ik.labels, measured.positions[some])
    held = {c: skeleton.locked.get(c, 0.0) for c in never}
    return model.lock(held), few, ik.errors_m[some]


def _arm_markers(skeleton: Skeleton, markers: Markers, side: str) -> int:
    """Count the markers of an arm that the trial has."""
    segments = (f"upper_arm_{side}", f"forearm_{side}")
    return sum(marker.segment in segments and marker.label in markers.labels for marker in skeleton.markers)


def _swapped_errors(skeleton: Skeleton, labels: tuple[str, ...], measured: np.ndarray) -> np.ndarray:
    """Return the `_typical` distance (h, m) m of each marker from the best fit, for h versions (h, f, m, 3)."""
    if not len(measured):
        return np.zeros((0, len(labels)))
    frames = measured.reshape(-1, *measured.shape[2:])
    unrelated = Markers(np.arange(len(frames), dtype=float), labels, frames)
    ik = solve_ik(skeleton, unrelated, consecutive=False, gain_tolerance_m2=_ENOUGH_M2, most_steps=_MOST_STEPS)
    return _typical(ik.errors_m.reshape(measured.shape[:3]))


def _typical(errors: np.ndarray) -> np.ndarray:
    """Return the typical error (..., m) of errors (..., f, m): the median over frames, 0 for a marker that is not seen.

    The fit starts from the upright pose and may fail in one of them.
    """
    seen = np.isfinite(errors).any(axis=-2)
    return np.where(seen, np.nanmedian(np.where(seen[..., None, :], errors, 0.0), axis=-2), 0.0)


_NEAR_M = 0.04
"""Largest distance of each marker from the other's position one frame before."""


@check("L211", unless=needs.LENGTH_UNIT + needs.MEASURED_FRAMES)
def label_swaps(context: RecordingContext) -> Iterator[Finding]:
    """Report L211: one finding per swap; where labels return to their own markers there is another."""
    markers = context.measured_markers
    if len(markers.time) < 5:
        return
    jumps = np.nan_to_num(np.linalg.norm(steps(markers.positions), axis=-1)) > step_limit_m(markers.rate_hz)
    for frame in np.flatnonzero(jumps.sum(axis=1) >= 2):
        jumping = np.flatnonzero(jumps[frame])
        before, after = markers.positions[frame + 1, jumping], markers.positions[frame + 2, jumping]
        apart = np.linalg.norm(before[:, None] - before, axis=-1)
        landed = np.linalg.norm(after[:, None] - before, axis=-1)
        swapped = np.maximum(landed, landed.T) < np.minimum(_NEAR_M, 0.5 * apart)
        span = (float(markers.time[frame + 1]), float(markers.time[frame + 2]))
        for a, b in np.argwhere(np.triu(swapped, 1)):
            yield finding(
                "L211",
                context.at(markers=(markers.labels[jumping[a]], markers.labels[jumping[b]]), span_s=span),
                distance_m=Quantity(float(apart[a, b]), "m"),
                time_s=Quantity(span[1], "s"),
            )
