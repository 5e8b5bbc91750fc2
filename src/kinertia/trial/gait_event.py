"""Defines `GaitEvent` and `FileEvent`: a foot strike or foot off, as measured and as a file states it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

EventKind = Literal["heel strike", "toe off"]

SAME_EVENT_S = 0.15
"""What a file and the forces have farther apart is another step."""


class GaitEvent(NamedTuple):
    """A foot meets the ground ("heel strike") or leaves it ("toe off") at a time (s)."""

    time_s: float
    side: str
    kind: EventKind


def nearest_event(events: Iterable[GaitEvent], to: GaitEvent, within_s: float) -> GaitEvent | None:
    """The event of the same foot and kind that is nearest in time, if it is near."""
    alike = [event for event in events if event[1:] == to[1:] and abs(event.time_s - to.time_s) <= within_s]
    return min(alike, key=lambda event: abs(event.time_s - to.time_s), default=None)


@dataclass(frozen=True)
class FileEvent:
    """An event that a file states.

    Attributes:
        time_s: on the clock of the markers.
        side: "r" or "l"; empty of a general event.
        label: as in the file: "Foot Strike", "Foot Off", the name of a general event.
        subject: whose it is; empty where the file does not tell.
        kind: what the foot does; None of a general event.

    Examples:
        >>> from kinertia.trial.gait_event import FileEvent
        >>> FileEvent(1.63, "l", "Foot Strike", "", "heel strike").of_gait
        GaitEvent(time_s=1.63, side='l', kind='heel strike')
    """

    time_s: float
    side: str
    label: str
    subject: str
    kind: EventKind | None

    @property
    def of_gait(self) -> GaitEvent | None:
        """The same as a gait event; None of a general one."""
        return None if self.kind is None or not self.side else GaitEvent(self.time_s, self.side, self.kind)
