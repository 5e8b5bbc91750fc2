"""Reads gait events of a C3D file, and writes those that it lacks into its group EVENT."""

import re
from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from kinertia.io.c3d.ezc3d_library import parameter_values, text_list
from kinertia.io.c3d.parameters import ParameterSection, Value
from kinertia.trial.file_contents import SAME_EVENT_S, EventKind, FileEvent, GaitEvent, nearest_event

_SIDES = {"right": "r", "left": "l", "r": "r", "l": "l"}
_ONE_LABEL = re.compile(r"(?:(right|left) (?=\w)|([rl]) ?(?=(?:hs|ic|fs|on|to|fo|off)$))(.*)")
_STRIKE, _OFF = "(foot|heel) (strike|contact|on)|initial contact|hs|ic|fs|on", "(foot|toe) off|to|fo|off"
OWN_METHOD = "Kinertia: "
"""Prefix of the descriptions of events that Kinertia wrote: they are results, which another export replaces."""
_SECONDS_PER_MINUTE = 60.0
_GROUP = "EVENT"
_CONTEXTS = {"r": "Right", "l": "Left"}
_LABELS = {"heel strike": "Foot Strike", "toe off": "Foot Off"}
_ICONS = {"heel strike": 1, "toe off": 2}
"""Vicon's."""
_MOST = 255


def file_events(parameters: Any, labels: Sequence[str] = ()) -> tuple[FileEvent, ...]:
    """Read all events in order of time.

    TIMES are 2 x n: minutes, which Vicon leaves zero, and seconds. Side and kind are Vicon's context ("Right", "Left",
    "General") and label ("Foot Strike", "Foot Off"), or one label such as "RHS" and "LTO". Lists go on in LABELS2,
    CONTEXTS2 and so on.

    Args:
        parameters: parameters of the file, as ezc3d has them.
        labels: labels of the markers; people with a prefix are not the trial's person.

    Events of other people are left out (`subjects_of_person`).
    """
    times = np.asarray(parameter_values(parameters, "EVENT", "TIMES"))
    if not np.issubdtype(times.dtype, np.number) or len(times) % 2:
        return ()
    times = times.astype(float).reshape(-1, 2)
    lists = [_texts(parameters, name, len(times)) for name in ("CONTEXTS", "LABELS", "SUBJECTS", "DESCRIPTIONS")]
    others = {label.split(":", 1)[0] for label in labels if ":" in label}
    person = person_among(text_list(parameters, "SUBJECTS", "NAMES"), others)
    own = subjects_of_person(lists[2], person, others)
    events = []
    for (minutes, seconds), context, name, subject, description in zip(times, *lists, strict=True):
        label = name or context  # Motion Analysis writes "RHS" as the context
        side, kind = side_and_kind(context, label)
        if subject in own and not description.startswith(OWN_METHOD):
            events.append(FileEvent(float(_SECONDS_PER_MINUTE * minutes + seconds), side, label, subject, kind))
    return tuple(sorted((one for one in events if np.isfinite(one.time_s)), key=lambda one: one.time_s))


def person_among(names: Sequence[str], others: Collection[str]) -> str:
    """Return the trial's person among the SUBJECTS of a file, where other people are known; empty where it is
    unknown."""
    left = [name for name in dict.fromkeys(names) if name and name not in others]
    return left[0] if len(left) == 1 else ""


def subjects_of_person(subjects: Iterable[str], person: str, others: Collection[str]) -> set[str]:
    """Return which subjects of events are the person: this name and the empty one, if an event has this name.

    Otherwise the person was renamed or is unknown, and every subject that is not one of the others counts.
    """
    found = set(subjects) - set(others)
    return found & {person, ""} if person in found and person else found


def _texts(parameters: Any, name: str, count: int) -> list[str]:
    """Return `count` strings of a list of the group EVENT; empty ones where it is shorter."""
    texts = text_list(parameters, "EVENT", name)
    return (texts + [""] * count)[:count]


def side_and_kind(context: str, label: str) -> tuple[str, EventKind | None]:
    """Identify side and kind from context and label; empty and None where neither states them."""
    side, word = _SIDES.get(context.lower(), ""), re.sub("[-_ ]+", " ", label.lower())
    whole = _ONE_LABEL.fullmatch(word)
    if whole and re.fullmatch(f"{_STRIKE}|{_OFF}", whole[3]) and side in ("", _SIDES[whole[1] or whole[2]]):
        side, word = _SIDES[whole[1] or whole[2]], whole[3]
    if re.fullmatch(_STRIKE, word):
        return side, "heel strike"
    return side, "toe off" if re.fullmatch(_OFF, word) else None


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
