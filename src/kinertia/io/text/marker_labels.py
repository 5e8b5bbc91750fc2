"""Cleans labels of markers: without the subject's name that Vicon puts before them, and none given twice."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from kinertia.errors import FileError
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.data import BoolArray

_PERSON_SHARE = 0.5
"""Share of the largest person's labels; a prefix with fewer is no second person, but a wand, or a stray label."""


def people_among(labels: Sequence[str]) -> dict[str, int]:
    """Return prefixes with about as many labels as any other, with their number of labels; most first."""
    prefixes = Counter(label.split(":", 1)[0] for label in labels if ":" in label).most_common()
    return {name: count for name, count in prefixes if count > _PERSON_SHARE * prefixes[0][1]}


def without_prefixes(path: Path, labels: Sequence[str], subject: str = "") -> tuple[list[str], list[Finding]]:
    """Remove `subject:` from labels and report it (F163); only the person of the trial loses the prefix.

    Args:
        path: the file.
        labels: labels of all its markers.
        subject: name of the trial's person; if empty, the person with most labels.

    Raises:
        FileError: several people have about as many labels, and the trial's person is unknown.
    """
    people = people_among(labels)
    if not people:
        return list(labels), []
    if len(people) > 1 and not subject:
        counted = ", ".join(f"{name}: {count}" for name, count in people.items())
        raise FileError.found(path, "F161", people=Quantity(counted), count=Quantity(len(people), "1"))
    subject = subject or next(iter(people))
    others = {label.split(":", 1)[0] for label in labels if ":" in label} - {subject}
    names = [label.removeprefix(subject + ":") for label in labels]
    kept = f" (not those of {', '.join(sorted(others))})" if others else ""
    count = sum(label != name for label, name in zip(labels, names, strict=True))
    return names, [left_out(path, count, f"label prefixes '{subject}:'{kept}")]


def left_out(path: Path, count: int, what: str) -> Finding:
    """Return the finding that a number of points, or parts of labels, were left out."""
    return finding("F163", Where(path.name), count=Quantity(count, "1"), what=Quantity(what))


def most_seen(path: Path, labels: Sequence[str], seen: BoolArray) -> tuple[dict[str, int], list[Finding]]:
    """Choose one trajectory for each label, the one in most frames, of equals the first; F113 lists repeated labels.

    Args:
        path: the file, for findings.
        labels: labels of the m trajectories.
        seen: (n, m) whether a frame shows them.

    Returns:
        label -> column of its trajectory, in the order of the file, and what was found.
    """
    chosen: dict[str, int] = {}
    frames = seen.sum(axis=0)
    for column, label in enumerate(labels):
        if label not in chosen or frames[column] > frames[chosen[label]]:
            chosen[label] = column
    findings = []
    for label, times in Counter(labels).items():
        if times > 1:
            evidence = {"count": Quantity(times, "1"), "label": Quantity(label)}
            findings.append(with_evidence("F113", Where(path.name, markers=(label,)), evidence, Severity.INFO))
    return chosen, findings
