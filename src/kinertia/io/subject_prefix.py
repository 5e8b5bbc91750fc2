"""Labels like `Anna:LASI`: Vicon puts the subject's name before the markers'."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path


def without_prefixes(path: Path, labels: Sequence[str]) -> tuple[list[str], list[str]]:
    """Labels without `subject:`, and notes; of several subjects only the one with most labels loses its prefix."""
    prefixes = Counter(label.split(":", 1)[0] for label in labels if ":" in label)
    if not prefixes:
        return list(labels), []
    subject = prefixes.most_common(1)[0][0]
    notes = [f"{path.name}: the prefix '{subject}:' was removed from the labels"]
    if len(prefixes) > 1:
        others = ", ".join(name for name in prefixes if name != subject)
        notes = [f"{path.name}: several subjects; '{subject}:' was removed from the labels, {others} keep theirs"]
    return [label.removeprefix(subject + ":") for label in labels], notes
