"""Writes gait events that a C3D file lacks into its group EVENT."""

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from kinertia.io.c3d.events import OWN_METHOD, person_among, side_and_kind, subjects_of_person
from kinertia.io.c3d.parameters import ParameterSection, Value
from kinertia.trial.gait_event import SAME_EVENT_S, GaitEvent, nearest_event

_GROUP = "EVENT"
_CONTEXTS = {"r": "Right", "l": "Left"}
_LABELS = {"heel strike": "Foot Strike", "toe off": "Foot Off"}
_ICONS = {"heel strike": 1, "toe off": 2}
"""Vicon's."""
_MOST = 255


class EventToWrite(NamedTuple):
    """A gait event, and the source of its time: "force plate" or "motion"."""

    event: GaitEvent
    method: str


class _Row(NamedTuple):
    """One event as stored in the lists of the group EVENT."""

    context: str
    label: str
    description: str
    subject: str
    icon: int
    flag: int
    minutes: float
    seconds: float

    @property
    def of_gait(self) -> GaitEvent | None:
        side, kind = side_and_kind(self.context, self.label or self.context)
        return None if kind is None or not side else GaitEvent(60.0 * self.minutes + self.seconds, side, kind)


def subject_of(section: ParameterSection, prefix: str) -> str:
    """Return the name that a file's events have for the trial's person; empty where the file has no names.

    Args:
        section: parameters of the file.
        prefix: name before the labels of the person's markers; empty for none.
    """
    if prefix:
        return prefix
    subjects = {row.subject for row in _rows(section) if not row.description.startswith(OWN_METHOD)}
    if len(subjects) == 1:
        return subjects.pop()
    names = section.get("SUBJECTS", "NAMES")
    return person_among([] if names is None else [str(name).strip() for name in names], ())


def add_events(
    section: ParameterSection, events: Sequence[EventToWrite], subject: str, others: Collection[str] = ()
) -> int:
    """Add the events that a file does not state, with their method as description; return how many were added.

    The file's own events keep their values and order. Nothing changes where there is none to add. Events of another
    person (`subjects_of_person`) do not count.

    Args:
        section: parameters of the file.
        events: all known events.
        subject: name of their person (`subject_of`).
        others: names of other people whose markers are in the file.
    """
    rows = _rows(section)
    own = [row for row in rows if not row.description.startswith(OWN_METHOD)]
    persons = subjects_of_person([row.subject for row in own], subject, others)
    stated = [event for row in own if row.subject in persons and (event := row.of_gait) is not None]
    new = [
        _Row(
            _CONTEXTS[one.event.side],
            _LABELS[one.event.kind],
            OWN_METHOD + one.method,
            subject,
            _ICONS[one.event.kind],
            0,
            0.0,
            one.event.time_s,
        )
        for one in events
        if nearest_event(stated, one.event, SAME_EVENT_S) is None
    ]
    if (new or len(own) < len(rows)) and len(own) + len(new) <= _MOST:
        _put(section, [*own, *new])
        return len(new)
    return 0


def _rows(section: ParameterSection) -> list[_Row]:
    """Read all events of the file; lists that are too short are padded with empty entries."""
    stored = section.get(_GROUP, "TIMES")
    times = np.zeros(0) if stored is None else np.asarray(stored, dtype=float)
    count = len(times) // 2

    def column(name: str, missing: str | int) -> list[Any]:
        value = section.get(_GROUP, name)
        known = [] if value is None else list(value)[:count]
        return known + [missing] * (count - len(known))

    texts = [column(name, "") for name in ("CONTEXTS", "LABELS", "DESCRIPTIONS", "SUBJECTS")]
    numbers = [column(name, 0) for name in ("ICON_IDS", "GENERIC_FLAGS")]
    pairs = times[: 2 * count].reshape(-1, 2).tolist()
    return [_Row(*row, *pair) for *row, pair in zip(*texts, *numbers, pairs, strict=True)]


def _put(section: ParameterSection, rows: Sequence[_Row]) -> None:
    """Write all events; flags are bytes as in Vicon's files, or keep the type that they have in this file."""
    flags = np.int8 if section.get(_GROUP, "GENERIC_FLAGS") is None else np.int16
    lists: dict[str, Value] = {
        "CONTEXTS": [row.context for row in rows],
        "LABELS": [row.label for row in rows],
        "DESCRIPTIONS": [row.description for row in rows],
        "SUBJECTS": [row.subject for row in rows],
        "ICON_IDS": np.array([row.icon for row in rows], dtype=np.int16),
        "GENERIC_FLAGS": np.array([row.flag for row in rows], dtype=flags),
        "USED": np.array([len(rows)], dtype=np.int16),
    }
    for name, value in lists.items():
        section.put(_GROUP, name, value)
    times = np.array([[row.minutes, row.seconds] for row in rows], dtype=np.float32)
    section.put(_GROUP, "TIMES", times, (2, len(rows)))
