"""L10: does a marker set fit the labels? Which of its labels a recording has, lacks, and spells otherwise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.io.marker_set_file import nearest_preset
from kinertia.model.marker_set import (
    MarkerSet,
    fits_person,
    matches_labels,
    nearest_labels,
    no_marker_set,
    with_nearest,
)


@dataclass(frozen=True, eq=False)
class MarkerSetMatch:
    """Which labels of a marker set a recording has.

    Attributes:
        name: name of the set.
        fits: whether it is the recording's set; if not, it is the nearest preset.
        missing: labels of the set that the recording lacks, each with the most similar labels of `others`.
        n_labels: number of labels of the set.
        others: labels of the recording that are not in the set and stay unused.
        of_model: whether the set is the markers of an OpenSim model.
    """

    name: str
    fits: bool
    missing: dict[str, list[str]]
    n_labels: int
    others: tuple[str, ...]
    of_model: bool


def match_labels(labels: Sequence[str], marker_set: MarkerSet | None) -> tuple[MarkerSetMatch, MarkerSet | None]:
    """Match the labels to the set, or to the nearest preset; return the match, and the set if it is the recording's."""
    wanted = nearest_preset(labels) if marker_set is None else marker_set
    if not wanted.landmarks:
        fits = bool(set(wanted.labels) & set(labels))
    else:
        fits = fits_person(wanted, labels) if marker_set is None else matches_labels(wanted, labels)
    used = wanted if fits else None
    others = tuple(label for label in labels if label not in wanted.labels)
    missing = nearest_labels([label for label in wanted.labels if label not in labels], others)
    return MarkerSetMatch(
        wanted.name, used is not None, missing, len(wanted.labels), others, not wanted.landmarks
    ), used


@check("L101", "L102", "L103")
def labels_match(context: RecordingContext) -> Iterator[Finding]:
    """Report L101 to L103: no marker set fits, labels are missing, or labels are spelled differently (one finding
    each)."""
    match, used = match_labels(context.all_markers.labels, context.marker_set)
    if used is None:
        yield replace(no_marker_set(match.name, match.n_labels, match.missing), where=context.at())
        return
    if match.missing:
        yield finding(
            "L102",
            context.at(markers=tuple(match.missing)),
            missing=Quantity(float(len(match.missing)), "1"),
            name=Quantity(match.name),
            labels=Quantity(with_nearest(match.missing)),
        )
    for label, written in used.respelled.items():
        yield finding("L103", context.at(markers=(written,)), written=Quantity(written), label=Quantity(label))
