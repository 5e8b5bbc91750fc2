"""Describes which ground reactions the joint moments of a trial are computed from, and why."""

from typing import NamedTuple

from kinertia.motion.ground_reactions import GroundReactions
from kinertia.settings import Settings

NOTABLE_IMPACT_N = 0.5
"""RMS below which impact transients are not mentioned."""


class ForcesUsed(NamedTuple):
    """Description of the ground reactions used for joint moments.

    Attributes:
        which: "as measured, ..."; used in headers of files, so without an equals sign.
        why: the rest of the sentence, with its punctuation in front; may be empty.
    """

    which: str
    why: str


def forces_used(reactions: GroundReactions, settings: Settings, motion_hz: float) -> ForcesUsed:
    """Describe what was done to the ground reactions of a trial before joint moments were computed from them.

    Args:
        reactions: used for the trial's joint moments.
        settings: as used.
        motion_hz: bandwidth of the motion.
    """
    which, why = _bandwidth(reactions, settings)
    if reactions.impact_n < NOTABLE_IMPACT_N:
        return ForcesUsed(which, why)
    size = f"impacts of {reactions.impact_n:.1f} N (RMS over the trial)"
    spikes = "spikes in the moments of knee and hip (Bisseling and Hof 2006, J Biomech 39:2438)"
    faster = f"faster than the motion ({motion_hz:g} Hz)"
    if settings.force_cutoff_hz == "none":
        return ForcesUsed(f"{which}, {size} included", f"{why}; they are {faster} and put {spikes}")
    keep = 'to keep them: force_cutoff_hz = "none" under [settings]'
    return ForcesUsed(f"{which}, less {size}", f"{why}; they are {faster} and would cause {spikes}; {keep}")


def forces_before(reactions: GroundReactions, settings: Settings) -> str:
    """Describe the ground reactions of the joint moments before the estimate, which include impact transients."""
    by_user = settings.method == "simultaneous" and not isinstance(settings.force_cutoff_hz, str)
    return "as measured" if by_user else _bandwidth(reactions, settings).which


def full_bandwidth(reactions: GroundReactions) -> str:
    """Return the label of residuals at the bandwidth of these ground reactions."""
    if reactions.cutoff_hz is None:
        return "forces at full bandwidth"
    return f"forces up to {reactions.cutoff_hz:.3g} Hz"


def _bandwidth(reactions: GroundReactions, settings: Settings) -> ForcesUsed:
    if reactions.cutoff_hz is None:
        return ForcesUsed("as measured", "")
    which = f"low-passed at {reactions.cutoff_hz:.3g} Hz"
    if settings.method == "two-level":
        return ForcesUsed(which, ", the bandwidth of the motion")
    if isinstance(settings.force_cutoff_hz, str):
        return ForcesUsed(which, ", because the plates are noisy when unloaded")
    return ForcesUsed(which, ", as force_cutoff_hz says")
