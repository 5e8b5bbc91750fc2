"""Resolves labels that a file of markers gives to more than one trajectory."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from kinertia.findings.finding import Finding, Severity, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.data import BoolArray


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
