"""Applies remedies of findings to a person's subject file, as a user would type them, and undoes them.

What was applied is noted with what stood there before; all else follows from the subject file.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from kinertia.cli.web.entries import entries, label_of, write
from kinertia.cli.web.file_table import Content, put_aside
from kinertia.cli.web.library import PersonFolder
from kinertia.errors import SettingsError
from kinertia.findings.remedy import DIAGNOSTICS, Remedy
from kinertia.io.subject.tables import trial_name

_NOTES = "remedies"
_LONGEST_REASON = 300


@dataclass(frozen=True)
class Button:
    """A remedy as a button: its words, its setting as text, and whether it takes a reason."""

    label: str
    text: str
    overrules: bool

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Button":
        """Make the button of a remedy that a check or a fit has left."""
        remedy = Remedy(**given)
        return cls(_label(remedy), remedy.text, remedy.overrules)


@dataclass(frozen=True)
class Applied:
    """A remedy that is in effect: its setting as text, and the reason given for it."""

    text: str
    reason: str


def _label(remedy: Remedy) -> str:
    """Describe a remedy in the words of a button."""
    match (remedy.table, remedy.key, remedy.value):
        case ("trial", "", _):
            return f"Leave out {remedy.trial}"
        case ("trial", "window_s", [start, end]):
            return f"Use {start:g} to {end:g} s of {remedy.trial} only"
        case ("model", "window_s", [start, end]):
            return f"Use {start:g} to {end:g} s of the static trial only"
        case ("trial", "leave_out", [*labels]):
            return f"Leave {' and '.join(labels)} out of {remedy.trial}"
        case ("model", "static", _):
            return "Do without the static trial"
        case ("model", "calibrate", _):
            return "Let markers and joint centres of the model move"
        case ("subject", "population", value):
            return f"Confirm the population: {value}"
        case ("subject", key, float() as value):
            return f"Set {label_of(key).lower()} to {value:g}"
        case ("diagnostics", "waive", _):
            return "Waive it, with a reason"
        case ("diagnostics", _, _):
            return "Ignore it, with a reason"
    return f"Set {remedy.text}"


def apply(person: PersonFolder, text: str, reason: str) -> None:
    """Write the setting of this text, which the last check or fit proposed, and note what stood there.

    Raises:
        SettingsError: no finding proposes it, or it overrules one without a reason.
    """
    remedy = next((proposed for proposed in _proposed(person) if proposed.text == text), None)
    if remedy is None:
        raise SettingsError("This remedy is of an earlier check: look at the findings again")
    why = " ".join(reason.split())[:_LONGEST_REASON]
    if remedy.overrules and not why:
        raise SettingsError(f"Say why {remedy.value} is overruled: the reason is filed with the results")
    content = entries(person)
    before = _now(content, remedy)
    _write(person, content, _with(content, remedy, remedy.value, why))
    noted = [note for note in person.notes().get(_NOTES, []) if Remedy(**note["remedy"]) != remedy]
    person.note(**{_NOTES: [*noted, {"remedy": remedy.to_dict(), "before": before, "reason": why}]})


def undo(person: PersonFolder, text: str) -> None:
    """Restore what stood in place of an applied setting."""
    noted = person.notes().get(_NOTES, [])
    for note in noted:
        remedy = Remedy(**note["remedy"])
        if remedy.text == text:
            content = entries(person)
            _write(person, content, _with(content, remedy, note["before"], ""))
    person.note(**{_NOTES: [note for note in noted if Remedy(**note["remedy"]).text != text]})


def applied(person: PersonFolder, content: Content) -> list[Applied]:
    """Return the applied remedies that the subject file still has."""
    found = [(Remedy(**note["remedy"]), note["reason"]) for note in person.notes().get(_NOTES, [])]
    return [Applied(remedy.text, reason) for remedy, reason in found if _now(content, remedy) == remedy.value]


def _proposed(person: PersonFolder) -> Iterator[Remedy]:
    for kind in ("results", "check"):
        outcome = person.outcome(kind)
        for finding in outcome.get("findings", []) if outcome.get("inputs") == person.inputs else []:
            yield from (Remedy(**setting) for setting in finding.get("settings", []))


def _write(person: PersonFolder, before: Content, after: Content) -> None:
    """Write the entries; if a trial is removed, keep its entries for when it is added again, as the form does."""
    write(person, after)
    person.note(aside=put_aside(before, after, person.notes().get("aside", [])))


def _trials(content: Content) -> list[dict[str, Any]]:
    trials = content.get("trial")
    return [dict(trial) for trial in trials if isinstance(trial, Mapping)] if isinstance(trials, list) else []


def _now(content: Content, remedy: Remedy) -> Any:
    """Return what stands in place of a setting: its value, or the whole trial; None for nothing."""
    holder: Any = content
    if remedy.trial:
        holder = next((trial for trial in _trials(content) if trial_name(trial) == remedy.trial), None)
        if holder is None or not remedy.key:
            return holder
    table = holder if remedy.table == "trial" else holder.get(remedy.table, {})
    if not remedy.overrules:
        return table.get(remedy.key)
    return remedy.value if remedy.value in table.get(remedy.key, []) else None


def _with(content: Content, remedy: Remedy, value: Any, reason: str) -> Content:
    """Return the entries with this value in place of a setting; None removes it."""
    if not remedy.trial:
        return _in_table(content, remedy, value, reason)
    trials = []
    for trial in _trials(content):
        if trial_name(trial) != remedy.trial:
            trials.append(trial)
        elif remedy.overrules:
            trials.append(_in_table(trial, remedy, value, reason))
        elif remedy.key:
            trials.append(_set(trial, remedy.key, value))
    if not remedy.key and value is not None:
        trials.append(value)
    return _set(content, "trial", trials or None)


def _in_table(content: Content, remedy: Remedy, value: Any, reason: str) -> Content:
    table = dict(content.get(remedy.table, {}))
    if not remedy.overrules:
        changed = _set(table, remedy.key, value)
        needed = changed or remedy.table == "model"  # which every subject file has
        return _set(content, remedy.table, changed if needed else None)
    code = remedy.value
    codes = [listed for listed in table.get(remedy.key, []) if listed != code] + ([] if value is None else [code])
    reasons = {listed: why for listed, why in table.get("reasons", {}).items() if listed != code}
    table = _set(table, remedy.key, codes or None)
    table = _set(table, "reasons", {**reasons, **({code: reason} if value is not None else {})} or None)
    return _set(content, DIAGNOSTICS, table or None)


def _set(table: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    if value is None:
        return {name: kept for name, kept in table.items() if name != key}
    return {**table, key: value}
