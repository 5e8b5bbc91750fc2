"""Reads what C3D files state besides markers and forces: gait events, and the person's mass, stature and measures.

The format has no place for them. Vicon's Plug-in Gait writes them to PROCESSING (`Bodymass` in kg, `Height` and
`LKneeWidth` in mm), others to SUBJECTS or SUBJECT, in spellings and units of their own. Nothing is read from a file
with several people, since it is unknown whose data they are.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.c3d.ezc3d_library import parameter_values, text_list
from kinertia.io.c3d.parameters import ParameterSection, Value
from kinertia.model.marker_set import folded
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
_GROUPS = ("PROCESSING", "SUBJECT", "SUBJECTS", "SUBJECT_DATA", "PATIENT", "ANTHROPOMETRY", "ANTHROPOMETRICS")
"""The first that has a quantity counts."""
_MASS = re.compile(r"(body|subject|patient)?(mass|weight)")
_HEIGHT = re.compile(r"(body|subject|patient)?(height|stature)")
_SIDES_OF_BODY = {"r": "R", "right": "R", "l": "L", "left": "L"}
_SIDE = "|".join(_SIDES_OF_BODY)
_MEASURE = re.compile(rf"({_SIDE})?(knee|ankle|elbow|wrist|leg)(width|diameter|breadth|length)({_SIDE})?")
_OTHER_LENGTH = re.compile(r"(Width|Length|Distance|Thickness|ShoulderOffset|SoleDelta)$", re.IGNORECASE)
_SUBJECT = re.compile(r"^[A-Z]_")
_UNIT = re.compile(r"[\s_([]+(kg|mm|cm|m)[])]?\s*$", re.IGNORECASE)
_NUMBER = re.compile(r"\s*(\d+(?:[.,]\d+)?)\s*(kg|mm|cm|m)?\s*", re.IGNORECASE)
_NEXUS_LINE = re.compile(r"^[ \t]*\$(\w+)[ \t]*=[ \t]*([\d.,]+)[ \t]*$", re.MULTILINE)
_PER_METRE = {"mm": 1000.0, "cm": 100.0, "m": 1.0}
_MASS_KG, _HEIGHT_M, _BMI = (8.0, 300.0), (0.5, 2.5), (7.0, 90.0)
"""Plausible ranges for people who walk, from children of one year on."""
_LIMITS_M = {
    "KneeWidth": (0.03, 0.2),
    "AnkleWidth": (0.02, 0.15),
    "ElbowWidth": (0.02, 0.15),
    "WristWidth": (0.015, 0.12),
    "LegLength": (0.2, 1.4),
}


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
    of_person = subjects_of_person(lists[2], person, others)
    events = []
    for (minutes, seconds), context, name, subject, description in zip(times, *lists, strict=True):
        label = name or context  # Motion Analysis writes "RHS" as the context
        side, kind = side_and_kind(context, label)
        if subject in of_person and not description.startswith(OWN_METHOD):
            events.append(FileEvent(float(_SECONDS_PER_MINUTE * minutes + seconds), side, label, subject, kind))
    return tuple(sorted((event for event in events if np.isfinite(event.time_s)), key=lambda event: event.time_s))


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
    of_file = [row for row in rows if not row.description.startswith(OWN_METHOD)]
    persons = subjects_of_person([row.subject for row in of_file], subject, others)
    stated = [event for row in of_file if row.subject in persons and (event := row.of_gait) is not None]
    new = [
        _Row(
            _CONTEXTS[found.event.side],
            _LABELS[found.event.kind],
            OWN_METHOD + found.method,
            subject,
            _ICONS[found.event.kind],
            0,
            0.0,
            found.event.time_s,
        )
        for found in events
        if nearest_event(stated, found.event, SAME_EVENT_S) is None
    ]
    if (new or len(of_file) < len(rows)) and len(of_file) + len(new) <= _MOST:
        _put(section, [*of_file, *new])
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


@dataclass(frozen=True)
class SubjectData:
    """Mass (kg), stature (m) and further lengths (m) by key, Plug-in Gait's under its own names too (`RKneeWidth`);
    with findings.
    """

    mass_kg: float | None
    height_m: float | None
    measurements: dict[str, float]
    findings: list[Finding]


def subject_data(path: Path, parameters: Any) -> SubjectData:
    """Read the person's data from the file; implausible values are left out (F125).

    Args:
        path: the file, for findings.
        parameters: parameters of the file, as ezc3d has them.
    """
    given = dict(_numbers(parameters))
    masses = {key: value for key, value in given.items() if _of_subject(_MASS, key)}
    heights = {key: value for key, value in given.items() if _of_subject(_HEIGHT, key)}
    mass, _ = next(iter(masses.values()), (None, None))
    height, unit = next(iter(heights.values()), (None, None))
    if height is not None:
        unit = unit or ("m" if height < 3 else "cm" if height < 300 else "mm")
        height /= _PER_METRE[unit]
    found: list[Finding] = []
    if mass is not None and not (_within(mass, _MASS_KG) and _within(_bmi(mass, height), _BMI)):
        found.append(_implausible(path, "mass", Quantity(mass, "kg")))
        mass = None
    if height is not None and not _within(height, _HEIGHT_M):
        found.append(_implausible(path, "stature", Quantity(height, "m")))
        height = unit = None
    lengths, doubted = _lengths(
        path, {key: length for key, length in given.items() if key not in heights}, unit or "mm"
    )
    if height is not None or lengths:
        found.append(finding("F124", Where(path.name), unit=Quantity(unit or "mm")))
    return SubjectData(mass, height, lengths, [*found, *doubted])


def nexus_measures(path: Path) -> SubjectData:
    """Read the person's data from the measures that Vicon Nexus keeps beside its recordings: `$Bodymass = 60`, lengths
    in mm, zero where nothing was measured.
    """
    lines = _NEXUS_LINE.findall(path.read_text(encoding="utf-8", errors="replace"))
    return subject_data(path, {"PROCESSING": {key: {"value": [value]} for key, value in lines}})


def _numbers(parameters: Any) -> Iterator[tuple[str, tuple[float, str | None]]]:
    """Yield each single positive number of the groups that describe a person, with the unit that it or its key has."""
    known: set[str] = set()
    for group in _GROUPS:
        for key in parameters.get(group, ()):
            if key == "__METADATA__" or key in known:
                continue
            values = parameter_values(parameters, group, key, [""])
            number = _number(values[0]) if np.size(values) == 1 else None
            if number is not None and number[0] > 0:
                known.add(key)
                named = _UNIT.search(key)
                yield key, (number[0], number[1] or (named[1].lower() if named else None))


def _number(value: Any) -> tuple[float, str | None] | None:
    if isinstance(value, (int, float, np.number)):
        return float(value), None
    written = _NUMBER.fullmatch(str(value))
    if written is None:
        return None
    return float(written[1].replace(",", ".")), written[2].lower() if written[2] else None


def _named(pattern: re.Pattern[str], key: str) -> re.Match[str] | None:
    return pattern.fullmatch(folded(_UNIT.sub("", key)))


def _of_subject(pattern: re.Pattern[str], key: str) -> bool:
    """Decide whether a key is this quantity; some programs write a subject's letter before it, A_BodyMass_kg."""
    return bool(_named(pattern, key) or _named(pattern, _SUBJECT.sub("", key)))


def _lengths(
    path: Path, given: Mapping[str, tuple[float, str | None]], unit: str
) -> tuple[dict[str, float], list[Finding]]:
    """Return lengths in m, and F125 for lengths that no unit makes plausible.

    Where the unit of the stature does not fit a joint width, the only one that does is taken.
    """
    lengths: dict[str, float] = {}
    doubted = []
    for key, (value, stated) in given.items():
        measure = _named(_MEASURE, key)
        kind = None if measure is None else _kind(measure)
        if kind is None:
            if _OTHER_LENGTH.search(key):
                lengths[key] = value / _PER_METRE[stated or unit]
            continue
        units = [stated] if stated else [unit, *_PER_METRE]
        fitting = [
            candidate for candidate in dict.fromkeys(units) if _within(value / _PER_METRE[candidate], _LIMITS_M[kind])
        ]
        if not fitting:
            doubted.append(_implausible(path, key, Quantity(value / _PER_METRE[stated or unit], "m")))
            continue
        lengths[key] = value / _PER_METRE[fitting[0]]
        assert measure is not None
        side = _SIDES_OF_BODY.get(measure[1] or measure[4] or "")
        for letter in [side] if side else ["R", "L"]:
            lengths.setdefault(f"{letter}{kind}", lengths[key])
    return lengths, doubted


def _kind(measure: re.Match[str]) -> str | None:
    kind = measure[2].capitalize() + ("Length" if measure[3] == "length" else "Width")
    return kind if kind in _LIMITS_M else None


def _within(value: float | None, limits: tuple[float, float]) -> bool:
    return value is None or limits[0] <= value <= limits[1]


def _bmi(mass_kg: float, height_m: float | None) -> float | None:
    return None if height_m is None or not _within(height_m, _HEIGHT_M) else mass_kg / height_m**2


def _implausible(path: Path, quantity: str, value: Quantity) -> Finding:
    return finding("F125", Where(path.name), value=value, quantity=Quantity(quantity))
