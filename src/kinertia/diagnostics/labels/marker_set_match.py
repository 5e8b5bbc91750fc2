"""Which marker set a recording has, and what of it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from kinertia.diagnostics.result.verdict import Verdict
from kinertia.errors import MarkerSetError
from kinertia.io.marker_set_file import choose_marker_set, nearest_preset
from kinertia.model.marker_set import MarkerSet, check_marker_set, nearest_labels
from kinertia.trial.data import Recording


@dataclass(frozen=True, eq=False)
class MarkerSetMatch:
    """Which labels of a marker set a recording has.

    Attributes:
        name: of the set.
        fits: whether it is the recording's set; if not, it is the nearest preset.
        missing: labels of the set that the recording lacks, each with those of `others` that look most alike.
        n_labels: of the set.
        others: labels of the recording that are not in the set and stay unused.
        of_model: whether the set is the markers of an OpenSim model.
    """

    name: str
    fits: bool
    missing: dict[str, list[str]]
    n_labels: int
    others: tuple[str, ...]
    of_model: bool


def common_marker_set(recordings: Sequence[Recording]) -> MarkerSet | None:
    """The preset that a fit would choose for one of these recordings of one person; None if for none."""
    for recording in recordings:
        with suppress(MarkerSetError):
            return choose_marker_set(recording.markers.labels)
    return None


def match_labels(labels: Sequence[str], marker_set: MarkerSet | None) -> tuple[MarkerSetMatch, MarkerSet | None]:
    """How the labels fit the set, or the nearest preset; and the set if it is theirs."""
    wanted = nearest_preset(labels) if marker_set is None else marker_set
    used: MarkerSet | None = wanted
    try:
        if marker_set is None:
            choose_marker_set(labels)
        elif marker_set.landmarks:
            check_marker_set(marker_set, labels)
        elif not set(marker_set.labels) & set(labels):
            used = None
    except MarkerSetError:
        used = None
    others = tuple(label for label in labels if label not in wanted.labels)
    missing = nearest_labels([label for label in wanted.labels if label not in labels], others)
    return MarkerSetMatch(
        wanted.name, used is not None, missing, len(wanted.labels), others, not wanted.landmarks
    ), used


def judged_labels(match: MarkerSetMatch) -> list[Verdict]:
    """Whether a fit knows which marker is where."""
    had = match.n_labels - len(match.missing)
    if match.fits:
        return [Verdict("pass", f"{had} of the {match.n_labels} labels of the marker set {match.name} are present")]
    if match.of_model:
        return [Verdict("fail", f"no label of the model {match.name} is in the file; expected its markers' names")]
    nearest = f"of the nearest, {match.name}, {had} of {match.n_labels} labels are present"
    nearest = nearest if had else "no preset shares a label with the file"
    return [
        Verdict(
            "fail",
            f"no marker set fits ({nearest}), so it is unknown which markers are on which foot; write a marker set as "
            f"TOML (kinertia markers FILE -o SET.toml drafts it) and name it with --markers",
        )
    ]
