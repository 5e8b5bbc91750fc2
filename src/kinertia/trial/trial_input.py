"""A recording of a motion and the window of it that the user vouches for."""

from __future__ import annotations

from dataclasses import dataclass

from kinertia.trial.data import Recording


@dataclass(frozen=True)
class TrialInput:
    """A recording and, where the user gives one, the window (s) to use instead of the detected one.

    Examples:
        >>> walk = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> kinertia.TrialInput(walk, window_s=(0.5, 1.0)).window_s
        (0.5, 1.0)
    """

    recording: Recording
    window_s: tuple[float, float] | None = None
    read_seconds: float = 0.0
