"""Labels like `Anna:LASI`: Vicon puts the subject's name before the markers'."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from kinertia.errors import FileError

_PERSON_SHARE = 0.5
"""Of the labels of whoever has most; what has fewer is no second person, but a wand, or a label gone astray."""


def people_among(labels: Sequence[str]) -> dict[str, int]:
    """Prefixes with about as many labels as any other has, and how many these are; most first."""
    prefixes = Counter(label.split(":", 1)[0] for label in labels if ":" in label).most_common()
    return {name: count for name, count in prefixes if count > _PERSON_SHARE * prefixes[0][1]}


def without_prefixes(path: Path, labels: Sequence[str], subject: str = "") -> tuple[list[str], list[str]]:
    """Labels without `subject:`, and notes; only the person of the trial loses the prefix.

    Args:
        path: the file.
        labels: of all its markers.
        subject: whose trial it is; empty where nobody knows, and whoever has most labels is taken.

    Raises:
        FileError: several people have about as many labels, and nobody knows whose trial it is.
    """
    people = people_among(labels)
    if not people:
        return list(labels), []
    if len(people) > 1 and not subject:
        counted = ", ".join(f"{name}: {count}" for name, count in people.items())
        raise FileError(
            path,
            f"markers of several people ({counted}), and nothing tells which of them is meant, as loaded plates "
            "under one of them would; export it with one of them only",
        )
    subject = subject or next(iter(people))
    others = {label.split(":", 1)[0] for label in labels if ":" in label} - {subject}
    notes = [f"{path.name}: the prefix '{subject}:' was removed from the labels"]
    if others:
        keep = f"{', '.join(sorted(others))} keep theirs"
        notes = [f"{path.name}: several subjects; '{subject}:' was removed from the labels, {keep}"]
    return [label.removeprefix(subject + ":") for label in labels], notes
