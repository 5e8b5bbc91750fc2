"""What does a person do: stand, walk, turn, run, land, squat? Do the movements include what complements walking best?

In the synthetic laboratory, adding a trial of trunk sway lowers the errors of moments of inertia by a third, more than
any other movement (`kinertia plan` predicts both for a person's own trials).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.estimation.simultaneous.instruments.priors import JOINT_CENTRE_SD_M, WITHOUT_STATIC
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity
from kinertia.motion.pose_fit import hidden_landmarks
from kinertia.trial.data import BoolArray, Markers
from kinertia.trial.marker_quality import LEAST_WALK_M, STANDING_RANGE_M, still_span_s
from kinertia.trial.sampled_data import runs, span_s
from kinertia.trial.trial_input import Task

SWAY_RAD, SQUAT_M = Limit(np.radians(12.0), "rad", usual=(0.0, np.radians(5.0))), Limit(0.15, "m", usual=(0.0, 0.08))
"""A walking trunk leans by up to 5 degrees from its mean; a walking pelvis moves up and down by up to 0.08 m."""
_FLIGHT_S = 0.03
"""Shortest flight of a run; contacts by markers are uncertain by about as much."""
_LANDING_S = 0.1
"""Shortest flight before a landing: walking has none."""
_FLAT_M = Limit(0.04, "m", usual=(0.0, 0.012))
"""Heels, and metatarsals, of seven people who stand are up to 12 mm higher on one side than on the other."""


@dataclass(frozen=True)
class InformativeMovements:
    """Range of movement of trunk and pelvis.

    Attributes:
        trunk_lean_rad: largest angle of the line from pelvis to torso from its mean.
        drop_m: distance from the highest to the lowest position of the pelvis.

    >>> InformativeMovements(0.073, 0.05).sentence()
    'the trunk leans by up to 4 degrees from its mean, the pelvis moves up and down by 5 cm'
    >>> InformativeMovements(0.07, 0.05).sways, InformativeMovements(0.35, 0.3).squats
    (False, True)
    """

    trunk_lean_rad: float
    drop_m: float

    @classmethod
    def of(cls, markers: Markers, pelvis: Sequence[str], torso: Sequence[str]) -> Self | None:
        """Compute the movement from markers with these labels; None where no frame shows all that are ever visible."""
        middles = []
        for labels in (pelvis, torso):
            of_segment = markers.positions[
                :, [markers.labels.index(label) for label in labels if label in markers.labels]
            ]
            used = np.isfinite(of_segment).any(axis=(0, 2))
            if not used.any():
                return None
            # of the same markers in every frame, or a gap would move their middle
            middles.append(of_segment[:, used].mean(axis=1))
        shown = np.isfinite(middles).all(axis=(0, 2))
        if not shown.any():
            return None
        low, high = (middle[shown] for middle in middles)
        line = high - low
        line /= np.linalg.norm(line, axis=1, keepdims=True)
        mean = line.mean(axis=0)
        lean = np.arccos(np.clip(line @ mean / np.linalg.norm(mean), -1.0, 1.0))
        return cls(float(lean.max()), float(np.ptp(low[:, 1])))

    @property
    def sways(self) -> bool:
        """Whether the trunk sways more than in walking."""
        return self.trunk_lean_rad > SWAY_RAD

    @property
    def squats(self) -> bool:
        """Whether the person squats, or sits down, climbs, or jumps."""
        return self.drop_m > SQUAT_M

    def sentence(self) -> str:
        """Describe the movement in words."""
        return (
            f"the trunk leans by up to {np.degrees(self.trunk_lean_rad):.0f} degrees from its mean, "
            f"the pelvis moves up and down by {100 * self.drop_m:.0f} cm"
        )


@check("S312", sway=SWAY_RAD, squat=SQUAT_M)
def informative_movements(context: PersonContext) -> Iterator[Finding]:
    """Report S312: no trial with forces shows trunk sway, or none shows squats."""
    measured = [movements_of(trial) for trial in context.trials if trial.plates is not None]
    known = [movements for movements in measured if movements is not None]
    lacking = [
        name
        for name, there in (
            ("trunk sway", any(movements.sways for movements in known)),
            ("squats", any(movements.squats for movements in known)),
        )
        if not there
    ]
    if known and lacking:
        yield finding(
            "S312",
            movements=Quantity(" or ".join(lacking)),
            lean_rad=Quantity(max(movements.trunk_lean_rad for movements in known), "rad", limit=SWAY_RAD),
            drop_m=Quantity(max(movements.drop_m for movements in known), "m", limit=SQUAT_M),
        )


def movements_of(context: RecordingContext) -> InformativeMovements | None:
    """Compute how far trunk and pelvis move in a recording; None where its markers do not show both."""
    segments = {} if context.marker_set is None else context.marker_set.segments
    return InformativeMovements.of(context.all_markers, *(segments.get(name, ()) for name in ("pelvis", "torso")))


def task_of(context: RecordingContext) -> Task:
    """Return the task: as stated, or found from the contacts of the feet, the heading and height of the pelvis.

    Strides (`RecordingContext.has_strides`) with a flight phase and without double support are a run, others a turn
    where the pelvis turns by more than 30 degrees, else a walk. Without strides it is a landing where both feet land
    after 0.1 s in the air, and a squat where both stay on the ground while the pelvis moves up and down by 0.15 m.
    """
    if context.stated_task is not None:
        return context.stated_task
    trial = context.trial
    ground = None if trial is None or trial.on_ground is None else trial.on_ground
    if context.has_strides:
        runs_ = ground is not None and _runs(context.all_markers.time, ground)
        return "turn" if context.turns else "run" if runs_ else "walk"
    if ground is None:
        return "other"
    if _flights(context.all_markers.time, ground, _LANDING_S):
        return "landing"
    movements = movements_of(context)
    return "squat" if movements is not None and movements.squats and ground.all() else "other"


def _runs(time: np.ndarray, ground: BoolArray) -> bool:
    """Return whether the feet (n, 2) are in the air together between contacts, and never on the ground together."""
    flights = _flights(time, ground, _FLIGHT_S)
    first, last = (flights[0][0], flights[-1][1]) if flights else (0, -1)
    return bool(flights) and not ground[first : last + 1].all(axis=1).any()


def _flights(time: np.ndarray, ground: BoolArray, least_s: float) -> list[tuple[int, int]]:
    """Return first and last frame of the flights between two contacts that last so long."""
    air = runs(~np.logical_or.reduce(ground, axis=1))
    return [(a, b) for a, b in air if a > 0 and b < len(time) - 1 and span_s(time, a - 1, b + 1) > least_s]


@check("S201", walk=Limit(LEAST_WALK_M, "m"))
def standing(context: RecordingContext) -> Iterator[Finding]:
    """Report S201: a person who walks in the static trial, with the part in which they stand."""
    if context.travel.kind != "walks":
        return
    distance = Quantity(context.travel.distance_m, "m", limit=LEAST_WALK_M, usual=(0.0, STANDING_RANGE_M))
    span = still_span_s(context.markers)
    action = "Give the standing trial, or none"
    if span is not None:
        action = f"Use the part in which the person stands: window_s = [{span[0]:.2f}, {span[1]:.2f}] under [model]"
    yield finding("S201", context.at(span_s=span), distance_m=distance, action=Quantity(action))


@check("S207", "S208")
def no_static(context: PersonContext) -> Iterator[Finding]:
    """Report S207: there is neither a static trial nor a model, and a walk replaces them; S208: no walk can."""
    unread = any(reported.rule.stage == "file" and reported.where.trial is None for reported in context.found)
    if not context.trials or context.standing or context.model or context.files_only or unread:
        return
    yield finding("S207", centre_sd_m=Quantity(WITHOUT_STATIC * JOINT_CENTRE_SD_M, "m"))
    measured = [trial.recording for trial in context.trials if trial.recording.plates is not None]
    if measured and context.marker_set and (hidden := hidden_landmarks(measured[0].markers, context.marker_set)):
        yield finding("S208", landmarks=Quantity(", ".join(hidden)))


@check("S202", apart=_FLAT_M)
def flat_feet(context: RecordingContext) -> Iterator[Finding]:
    """Report S202: a foot that is not on the floor like the other; foot axes assume that the foot is flat on the
    floor."""
    if context.marker_set is None:
        return
    apart = {}
    for name in ("heel", "metatarsal"):
        labels = (context.marker_set.landmarks.get(f"{name}_{side}", ())[:1] for side in "rl")
        heights = [context.all_markers.arranged(of_foot)[..., 1] for of_foot in labels]
        if all(np.isfinite(height).any() for height in heights):
            right_m, left_m = (float(np.nanmedian(height)) for height in heights)
            apart[name] = right_m - left_m
    if not apart:
        return
    landmark, higher_m = max(apart.items(), key=lambda landmark_height: abs(landmark_height[1]))
    if abs(higher_m) >= _FLAT_M:
        yield finding(
            "S202",
            context.at(part="right foot" if higher_m > 0 else "left foot"),
            difference_m=Quantity(abs(higher_m), "m", limit=_FLAT_M, usual=_FLAT_M.usual),
            landmark=Quantity(landmark),
        )
