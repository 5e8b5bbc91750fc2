"""Reads events of a C3D file: foot strikes, foot offs and general ones, of the group EVENT."""

import re
from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np

from kinertia.io.c3d.ezc3d_library import parameter_values, text_list
from kinertia.trial.gait_event import EventKind, FileEvent

_SIDES = {"right": "r", "left": "l", "r": "r", "l": "l"}
_ONE_LABEL = re.compile(r"(?:(right|left) (?=\w)|([rl]) ?(?=(?:hs|ic|fs|on|to|fo|off)$))(.*)")
_STRIKE, _OFF = "(foot|heel) (strike|contact|on)|initial contact|hs|ic|fs|on", "(foot|toe) off|to|fo|off"
OWN_METHOD = "Kinertia: "
"""Prefix of the descriptions of events that Kinertia wrote: they are results, which another export replaces."""
_SECONDS_PER_MINUTE = 60.0


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
