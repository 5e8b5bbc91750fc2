"""Holds a recording of a motion, the window that the user states, and its use."""

from dataclasses import dataclass
from typing import Literal

from kinertia.trial.data import Recording

TrialUse = Literal["all", "kinematics"]
Task = Literal["walk", "turn", "run", "landing", "squat", "other"]
"""What a person does in a trial; results of different tasks are not averaged."""
GAIT: tuple[Task, ...] = ("walk", "turn", "run")
"""Tasks that consist of strides."""
WITHOUT_STRIDES: tuple[Task, ...] = ("landing", "squat")
"""Tasks in which no strides are looked for."""


@dataclass(frozen=True)
class TrialInput:
    """A recording and, if the user gives one, the window (s) to use instead of the detected one.

    Attributes:
        recording: as read.
        window_s: first and last time; None: as detected.
        read_seconds: time that reading it took.
        task: what the person does; None: as found.
        condition: under which the trial was recorded, as the laboratory names it; trials of two can be compared.
        use: "all", or "kinematics" to use its markers alone, for joint centres, joint axes and marker positions.

    Examples:
        >>> walk = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> kinertia.TrialInput(walk, window_s=(0.5, 1.0)).window_s
        (0.5, 1.0)
    """

    recording: Recording
    window_s: tuple[float, float] | None = None
    read_seconds: float = 0.0
    use: TrialUse = "all"
    task: Task | None = None
    condition: str = ""
