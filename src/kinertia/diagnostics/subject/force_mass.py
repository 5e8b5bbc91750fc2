"""Do the ground reactions carry the person on the scale? Asked before inverse kinematics, of forces and markers alone.

Over a window the mean vertical force is m (g + dv / T), where dv is how much faster upwards the body's centre moves at
its end than at its beginning. The centre's velocity is that of the markers' centre, each segment at its usual share of
the body's mass: no model is fitted, so that nothing of ours can be wrong but a decimetre a second.

Where the forces do not fit, how they vary in time tells what is likely: nothing is known of a mass or a gain that is
not the same all the time, and a support that is not measured carries at most a part of the weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.markers_centre import markers_centre, owners_of
from kinertia.errors import TrialError
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.model.skeleton import GRAVITY_M_S2, Skeleton
from kinertia.motion.smoothing import MIN_SAMPLES, smooth
from kinertia.trial.data import FloatArray, Trial
from kinertia.trial.sampled_time import runs, span_s, within

CONTRADICTING_MASS = 0.10
"""Scale and vertical force, or two trials, may differ by this share, and by twice the deviation of the mass by force,
before an estimate refuses."""
VELOCITY_SD_M_S = 0.1
"""Deviation of the vertical velocity of the markers' centre from that of the body's, at either end of the window: half
of it is what arms and trunk do beside their markers, half what skin does."""
_FAST_HZ, _SLOW_HZ = 8.0, 4.0
_AROUND_S = 0.25
"""Frames this near the window help to know velocities at its ends."""
_FEWEST_FRAMES = 2 * MIN_SAMPLES
_CARRIED, _MISSING = 0.15, 0.25
"""Share of body weight within which all of it is carried, and from which on some of it is not."""
_SHORTEST_S = 0.1
UNMEASURED_S = 0.2
"""A part of the weight that is missing this long is on something else, whatever the mean says: in sound walks, runs and
jumps it is missing for 0.06 s at most, in flight."""
CARRIED_HINT = "if something was worn or carried that the scale did not weigh, give it as [[attached]]"
UNMEASURED_HINT = (
    "or see whether a part of the weight was on no plate (a handrail, a walker, crutches, a harness): all the time, it "
    "looks the same"
)
"""A part of the weight that is missing all the time varies less than the markers' centre tells: a support of 50 N and a
gain of 7 % part by 10 N in walking."""
_MOSTLY = 0.25
"""Share of the window in which all must be carried for the rest to be called an unmeasured contact."""


@dataclass(frozen=True, eq=False)
class ForceMass:
    """Body mass by the vertical force of one trial.

    Attributes:
        trial: its name.
        mass_kg, sd_kg: the mass that the forces move like the markers' centre, and its deviation.
        time: (n,) s, the frames of the window.
        carried: (n,) force over what a body of one kilogram would need for the same movement, kg.
    """

    trial: str
    mass_kg: float
    sd_kg: float
    time: FloatArray
    carried: FloatArray

    def contradicts(self, carried: CarriedMass) -> bool:
        """Whether a person of this mass can hardly have been on the plates."""
        allowed = CONTRADICTING_MASS * carried.total_kg + 2 * np.hypot(self.sd_kg, carried.sd_kg)
        return bool(abs(self.mass_kg - carried.total_kg) > allowed)

    def sentence(self, carried: CarriedMass) -> str:
        """What was found beside this stated mass, what may be the cause, and what to do."""
        mass_kg = carried.total_kg
        text = (
            f"from {self.time[0]:.3f} to {self.time[-1]:.3f} s the vertical force corresponds to {self.mass_kg:.1f} "
            f"kg; stated mass {carried}"
        )
        if hint := unit_hint(self.mass_kg, mass_kg):
            return f"{hint}: {text}"
        if self.mass_kg > mass_kg:
            return (
                f"{text}: {CARRIED_HINT}; else correct the mass, the gain, the zero or the units of the plates, or see "
                f"who else is on them"
            )
        if lost := self.lost_for_a_while(carried, _SHORTEST_S):
            return f"{text}; {lost}"
        return (
            f"{text}, and something is missing nearly all the time: correct the mass, or the gain and zero of the "
            f"plates, if nothing else can have carried a part of the weight (a chair, a handrail, a walker, crutches, "
            f"a harness, a foot beside the plates)"
        )

    def lost_for_a_while(self, carried: CarriedMass, shortest_s: float = UNMEASURED_S) -> str:
        """When a part of the weight is on no plate though at other times none is, and what to do; else empty."""
        share = self.carried / carried.total_kg - 1.0
        whole = np.abs(share) < _CARRIED
        spans = [(a, b) for a, b in runs(share < -_MISSING) if span_s(self.time, a, b) >= shortest_s]
        if whole.mean() < _MOSTLY or not spans:
            return ""
        first, last = max(spans, key=lambda span: span[1] - span[0])
        lost = -100.0 * float(share[first : last + 1].mean())
        more = f", and a part {len(spans) - 1} more times" if len(spans) > 1 else ""
        return (
            f"in {100 * whole.mean():.0f} % of the time the plates carry all of it, but from {self.time[first]:.3f} to "
            f"{self.time[last]:.3f} s {lost:.0f} % are missing{more}: something that is not measured was stood, sat or "
            f"leant on; give the other part of the trial as window_s"
        )


_UNITS = (
    (1 / GRAVITY_M_S2, "the forces look to be in kg (kilograms-force); export them in N"),
    (0.45359, "the stated mass looks to be in pounds; give it in kg"),
    (0.2248, "the forces look to be in pounds-force; export them in N"),
    (2.2046, "the stated mass looks to have been divided by the kilograms of a pound; give it in kg"),
    (0.001, "the forces look to be in kN; export them in N"),
)
_UNIT_OFF = 0.1
"""A ratio of forces to mass within this share of a ratio of units is likelier that of units than of people."""


def unit_hint(by_force_kg: float, stated_kg: float) -> str:
    """The unit that is wrong, where forces and stated mass differ as two units do; else empty."""
    ratio = by_force_kg / stated_kg
    return next((hint for factor, hint in _UNITS if abs(ratio / factor - 1) <= _UNIT_OFF), "")


def force_mass(skeleton: Skeleton, trial: Trial) -> ForceMass | None:
    """Body mass by the forces in the longest window in which their sum is known.

    Args:
        skeleton: which marker is on which segment; nothing else is used of it.
        trial: with measured frames.

    Returns:
        None where too few frames, or no markers, show how the body moves.
    """
    start, end = trial.carried_windows()[0]
    around, time = trial.markers.cut(start - _AROUND_S, end + _AROUND_S), trial.markers.cut(start, end).time
    place = markers_centre(owners_of(skeleton), around) if len(time) >= _FEWEST_FRAMES else None
    if place is None:
        return None
    height = place[:, 1]
    loads = trial.loads
    inside = within(loads.time, start, end)
    force = loads.force[:, :, 1].sum(axis=1)
    velocity = smooth(around.time, height, _FAST_HZ)(time[[0, -1]], 1)
    gained = float(velocity[1] - velocity[0]) / (time[-1] - time[0])
    specific = GRAVITY_M_S2 + gained
    if inside.sum() < MIN_SAMPLES or specific < 0.2 * GRAVITY_M_S2:
        return None
    mass = float(force[inside].mean()) / specific
    sd = mass * np.sqrt(2) * VELOCITY_SD_M_S / ((time[-1] - time[0]) * specific)
    slow = smooth(loads.time[inside], force[inside], _SLOW_HZ)(time)
    needed = GRAVITY_M_S2 + smooth(around.time, height, _SLOW_HZ)(time, 2)
    carried = np.where(needed > 0.3 * GRAVITY_M_S2, slow / np.maximum(needed, 0.3 * GRAVITY_M_S2), np.nan)
    return ForceMass(trial.name, mass, float(sd), time, carried)


def check_masses(carried: CarriedMass, by_force: Sequence[ForceMass]) -> None:
    """Raise TrialError when trials cannot be of one person, or not of the one on the scale."""
    for one in by_force:
        if one.contradicts(carried):
            raise TrialError(one.trial, one.sentence(carried))
    if by_force:
        heaviest, lightest = (pick(by_force, key=lambda one: one.mass_kg) for pick in (max, min))
        allowed = CONTRADICTING_MASS * lightest.mass_kg + 2 * np.hypot(heaviest.sd_kg, lightest.sd_kg)
        if heaviest.mass_kg - lightest.mass_kg > allowed:
            raise TrialError(
                heaviest.trial,
                f"the vertical force corresponds to {heaviest.mass_kg:.1f} kg, in '{lightest.trial}' "
                f"{lightest.mass_kg:.1f} kg; pool only trials of one person, with the same plates",
            )


def check_force_masses(skeleton: Skeleton, carried: CarriedMass, trials: Sequence[Trial]) -> None:
    """`check_masses` of the trials whose forces tell a mass."""
    check_masses(carried, [mass for trial in trials if (mass := force_mass(skeleton, trial)) is not None])
