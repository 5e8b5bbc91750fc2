"""L212 to L214 and R106: are labels swapped? Markers of a segment move together, and each swap is tried with the model.

On twelve fault-free trials, from squats to runs, distances within pelvis, thighs, shanks, feet and arms change by up to
39 mm (from the tenth to the ninetieth percentile of the frames; 20 mm in walks), and those between landmarks that one
joint joins by up to 38 mm. Markers on the other leg, or on the segment above, change theirs by 70 to 500 mm. On soft
thighs the change may reach 75 mm, but their markers then move with no other segment. Of 1867 swaps of two labels of
pelvis and legs in eight of these trials that change a distance by more than 60 mm, all but six are found.

Swapped markers pull the model away, so they need not have the largest errors, and the best fit may be far from the
truth (a foot turned round). They are recognised by how well everything fits once they are swapped back.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import step_limit_m, steps
from kinertia.diagnostics.runner import NEEDS_LENGTH_UNIT, NEEDS_MEASURED_FRAMES, check
from kinertia.estimation.calibration import sampled
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.gait27 import ARM_ROTATIONS, ELBOWS
from kinertia.model.marker_set import MarkerSet, in_words
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.trial.data import FloatArray, Markers, Recording, Trial

_SEGMENT_M, _JOINT_M = Limit(0.06, "m", usual=(0.0, 0.04)), Limit(0.10, "m")
"""Within a segment, if a marker moves with another; of landmarks on both sides of a joint."""
_ELSEWHERE = 0.35
"""Change of the distances to the markers of the segment with which a marker goes, over that to those of its own."""
_OWN_WAY = ("torso", "head", "upper_arm", "forearm", "hand")
"""Arms swing with the other leg, and seem to go with it."""
_TOGETHER_M, _CLEARLY_BETTER = 0.04, 0.4
_PERCENTILES = (0.1, 0.9)
_SPREAD = 2.563 * np.sqrt(2.0)
"""Spread between these percentiles of the distance of two markers with noise of SD 1."""
_FEWEST_FRAMES = 11
_SOFT = ("torso", "head")
"""Shoulders and head move against the trunk."""
_NEIGHBOURS = (("thigh", "shank"), ("shank", "foot"))
_SEVERAL = {"thigh": "thighs", "shank": "shanks", "foot": "feet"}
_CROSSED = 0.7
"""Distances to the next segment of the other leg change 1.9 times as much and more in fault-free walks and runs, and
alike where both legs do the same; swapped, 0.1 to 0.57 times."""
_JOINED = (("ankle_lateral", "heel"), ("ankle_lateral", "metatarsal"), ("elbow_lateral", "wrist"))
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
_NEAR_M = 0.04
"""Largest distance of each marker from the other's position one frame before."""


class _Pair(NamedTuple):
    """Change (m) of the distance of two markers, its limit `limit_m`, and the part that joins them."""

    change_m: float
    first: str
    second: str
    joined: str
    limit_m: float


@check("L213", "L214", unless=NEEDS_LENGTH_UNIT, segment=_SEGMENT_M, joint=_JOINT_M)
def rigidity(context: RecordingContext) -> Iterator[Finding]:
    """Report L213, one per marker that does not move with its segment; L214, one per segment on the wrong leg.

    Markers with faulty trajectories are left out. Noise beyond that of cameras widens the limits.
    """
    if context.marker_set is None:
        return
    faulty = context.trajectory_faults.labels
    markers = context.measured_markers
    markers = markers.select([label for label in markers.labels if label not in faulty])
    precise = context.marker_precision
    noise_m = _SPREAD * precise.noise_m if precise.noisy or precise.rounded else 0.0
    yield from _not_rigid(context, markers, context.marker_set, noise_m)
    yield from _crossed(context, markers, context.marker_set, float(np.hypot(_JOINT_M, noise_m)))


def _not_rigid(context: RecordingContext, markers: Markers, marker_set: MarkerSet, noise_m: float) -> Iterator[Finding]:
    far = [pair for pair in _pairs(markers, marker_set, noise_m) if pair.change_m > pair.limit_m]
    in_any_case = float(np.hypot(_JOINT_M, noise_m))
    marks = {label for name, labels in marker_set.landmarks.items() if "wand" not in name for label in labels}
    while far:
        count = Counter(label for pair in far for label in (pair.first, pair.second))
        worst = max(far)
        # a marker that is no landmark is more likely wrong, and one far from several others
        odd = max((worst.first, worst.second), key=lambda label: (label not in marks, count[label]))
        with_odd = [pair for pair in far if odd in (pair.first, pair.second)]
        far = [pair for pair in far if pair not in with_odd]
        mates = dict.fromkeys(label for pair in sorted(with_odd, reverse=True) for label in (pair.first, pair.second))
        involved = (odd, *(label for label in mates if label != odd))
        if worst.change_m < in_any_case and not any(_elsewhere(markers, marker_set, suspect) for suspect in involved):
            continue
        evidence = {
            "change_m": Quantity(worst.change_m, "m", limit=worst.limit_m, usual=_SEGMENT_M.usual),
            "segment": Quantity(in_words(worst.joined)),
        }
        better = _better(markers, marker_set, odd, worst.change_m)
        yield with_evidence("L213", context.at(markers=involved), evidence | better)


def _elsewhere(markers: Markers, marker_set: MarkerSet, odd: str) -> bool:
    """Return whether this marker moves with another segment of the legs or the pelvis."""
    segments = {
        name: [label for label in labels if label in markers.labels] for name, labels in marker_set.segments.items()
    }
    changes = {
        name: np.median(_changes_m(markers, [(odd, mate) for mate in labels if mate != odd]))
        for name, labels in segments.items()
        if set(labels) - {odd} and (odd in labels or not name.startswith(_OWN_WAY))
    }
    mine = max((change for name, change in changes.items() if odd in segments[name]), default=0.0)
    return any(change < _ELSEWHERE * mine for change in changes.values())


def _better(markers: Markers, marker_set: MarkerSet, odd: str, change_m: float) -> dict[str, Quantity]:
    """Return, as evidence, the marker of another segment that this marker moves with; empty where there is none."""
    owners = {label: name for name, labels in marker_set.segments.items() for label in labels}
    mates = [mate for mate in markers.labels if mate in owners and owners[mate] != owners.get(odd)]
    changes = _changes_m(markers, [(odd, mate) for mate in mates], np.inf)
    best = int(np.argmin(changes)) if mates else -1
    if best < 0 or changes[best] > min(_TOGETHER_M, _CLEARLY_BETTER * change_m):
        return {}
    return {
        "better_segment": Quantity(in_words(owners[mates[best]])),
        "better_marker": Quantity(mates[best]),
        "better_change_m": Quantity(float(changes[best]), "m"),
    }


def _crossed(context: RecordingContext, markers: Markers, marker_set: MarkerSet, least_m: float) -> Iterator[Finding]:
    """Find whole segments that move with the other leg: a set without markers at the joints shows it in no other
    way."""
    crossed: dict[tuple[str, str], tuple[float, float]] = {}
    measured = 0
    for upper, lower in _NEIGHBOURS:
        changes = {
            (a, b): _neighbours_change_m(markers, marker_set, f"{upper}_{a}", f"{lower}_{b}")
            for a in "rl"
            for b in "rl"
        }
        uncrossed = min(changes["r", "r"], changes["l", "l"])
        others = max(changes["r", "l"], changes["l", "r"])
        measured += bool(np.isfinite([*changes.values()]).all())
        if np.isfinite([*changes.values()]).all() and others < _CROSSED * uncrossed and uncrossed > least_m:
            crossed[upper, lower] = uncrossed, others
    if not crossed:
        return
    # shanks that are swapped go with the other leg's thighs and feet; with one of them unseen, either may be swapped
    ends = [name for pair in crossed for name in pair if name != "shank"]
    parts = ["shank"] if len(crossed) == 2 else [*ends, *(["shank"] if measured < 2 else [])]
    uncrossed, others = next(iter(crossed.values()))
    involved = [f"{name}_{side}" for name in ("shank", *ends) for side in "rl"]
    labels = [label for name in involved for label in marker_set.segments[name] if label in markers.labels]
    yield finding(
        "L214",
        context.at(markers=tuple(dict.fromkeys(labels))),
        own_change_m=Quantity(uncrossed, "m", limit=least_m),
        crossed_change_m=Quantity(others, "m", limit=_CROSSED * uncrossed),
        segments=Quantity(" or ".join(_SEVERAL[part] for part in parts)),
    )


def _neighbours_change_m(markers: Markers, marker_set: MarkerSet, upper: str, lower: str) -> float:
    """Return the median change (m) of the distances between markers of two segments; NaN where one has none."""
    here = set(markers.labels)
    above, below = ([label for label in marker_set.segments.get(name, ()) if label in here] for name in (upper, lower))
    changes = _changes_m(
        markers, [(above_label, below_label) for above_label in above for below_label in below], np.nan
    )
    return float(np.nanmedian(changes)) if np.isfinite(changes).any() else np.nan


def _pairs(markers: Markers, marker_set: MarkerSet, noise_m: float) -> list[_Pair]:
    here = set(markers.labels)
    within, across = float(np.hypot(_SEGMENT_M, noise_m)), float(np.hypot(_JOINT_M, noise_m))
    named: list[tuple[str, str, str, float]] = []
    for name, labels in marker_set.segments.items():
        if not name.startswith(_SOFT):
            present = [label for label in labels if label in here]
            named += [(first, other, name, within) for first, other in combinations(present, 2)]
    for upper, lower in _JOINED:
        for side in "rl":
            both = [marker_set.landmarks.get(f"{name}_{side}", ()) for name in (upper, lower)]
            if all(labels and labels[0] in here for labels in both):
                named.append((both[0][0], both[1][0], f"{upper.partition('_')[0]}_{side}", across))
    changes = _changes_m(markers, [(first, other) for first, other, *_ in named])
    return [_Pair(float(change), *which) for change, which in zip(changes, named, strict=True)]


def _changes_m(markers: Markers, pairs: Sequence[tuple[str, str]], unknown: float = 0.0) -> FloatArray:
    """Return by how much (p,) m the distance of each pair of markers changes; `unknown` where few frames show both."""
    place = {label: column for column, label in enumerate(markers.labels)}
    first, other = ([place[pair[end]] for pair in pairs] for end in (0, 1))
    apart: FloatArray = np.linalg.norm(markers.positions[:, first] - markers.positions[:, other], axis=2)
    seen = np.isfinite(apart)
    known = np.count_nonzero(seen, axis=0) >= _FEWEST_FRAMES
    always = known & seen.all(axis=0)
    changes = np.full(len(pairs), unknown)
    changes[always] = np.ptp(np.quantile(apart[:, always], _PERCENTILES, axis=0), axis=0)
    for pair in np.flatnonzero(known & ~always):
        changes[pair] = np.ptp(np.quantile(apart[seen[:, pair], pair], _PERCENTILES))
    return changes


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


@check("L211", unless=NEEDS_LENGTH_UNIT + NEEDS_MEASURED_FRAMES)
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
