"""Determines what changed between two sessions or conditions, from files, folders or results: `kinertia.compare`."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kinertia.errors import KinertiaError
from kinertia.estimation.change import Change
from kinertia.estimation.condition_changes import changes_of_strides, condition_features, masks_of
from kinertia.estimation.curve_changes import CurveChange, apart, curve_changes, paired, rows_of
from kinertia.estimation.gait_changes import gait_changes, speed_change
from kinertia.estimation.instrument_doubts import instrument_doubts
from kinertia.estimation.prepared import Progress
from kinertia.estimation.result import Fit
from kinertia.estimation.session_changes import (
    Session,
    changes_between,
    session,
    session_features,
    why_incomparable,
)
from kinertia.report.comparison.change_tables import (
    RELEVANT,
    change_rows,
    change_sentences,
    changed_sentence,
    changes_summary,
    curve_figures,
    limit_sentences,
    speed_sentence,
)
from kinertia.report.exports.saved_fit import load_fit
from kinertia.report.pages.rendering import rendered
from kinertia.workflow.from_files import fit_subject
from kinertia.workflow.session_fit import fit_session


@dataclass(frozen=True)
class Comparison:
    """What changed between two sessions or conditions.

    Attributes:
        before, after: their names.
        outcomes: joint moments and angles, event by event.
        speed: walking speed, which changes moments; None where it is not known.
        gait: cadence, stride length, share of stance and step width, where they are known.
        curves: joint moments and angles over the gait cycle, or over stance.
        doubt: findings about instruments that keep changes of moments from being judged.

    Examples:
        >>> found = kinertia.compare("before/subject.toml", "after/subject.toml")  # doctest: +SKIP
        >>> [one.difference for one in found.outcomes if one.verdict == "changed"]  # doctest: +SKIP
    """

    before: str
    after: str
    outcomes: tuple[Change, ...]
    speed: Change | None
    gait: tuple[Change, ...] = ()
    curves: tuple[CurveChange, ...] = ()
    doubt: str = ""

    @property
    def sentences(self) -> tuple[str, ...]:
        """Walking speed, each outcome that was named beforehand, how many of the others changed, and limits."""
        said = (speed_sentence(self.speed), *change_sentences(self.outcomes), changed_sentence(self.outcomes))
        return (*said, *limit_sentences(self.outcomes, self.doubt))

    @property
    def steps(self) -> tuple[Change, ...]:
        """Walking speed, where it is known, and `gait`."""
        return (() if self.speed is None else (self.speed,)) + self.gait

    def shown(self) -> dict[str, Any]:
        """Return what the templates show of it."""
        return {
            "before": self.before,
            "after": self.after,
            "sentences": self.sentences,
            "rows": change_rows(self.outcomes),
            "gait": change_rows(self.steps),
            "figures": curve_figures(self.curves, self.before, self.after),
            "relevant": RELEVANT,
        }

    def page(self) -> str:
        """Render the page of conditions of one session."""
        return rendered("changes_page.html.j2", title=f"{self.before} and {self.after}", changes=self.shown())

    @property
    def summary(self) -> dict[str, Any]:
        """What `kinertia compare --json` prints of it."""
        return {**changes_summary(self.before, self.after, self.outcomes, self.speed, self.gait), "doubt": self.doubt}


def compare(
    before: Fit | str | Path,
    after: Fit | str | Path | None = None,
    conditions: tuple[str, str] | None = None,
    progress: Progress = lambda stage, share: None,
) -> Comparison:
    """Determine what changed: joint moments and angles, event by event.

    Args:
        before, after: two sessions of one person: subject files, folders of results, or results. Without `after`,
            `conditions` of the first are compared.
        conditions: of the trials before and after, as their `condition` in the subject file.
        progress: called as the work progresses, with a stage's name and the share of it that is done.

    Raises:
        KinertiaError: they cannot be compared; it says why.
    """

    def share_done(share: float) -> None:
        progress("comparison", share)

    if after is not None:
        fits = (fit_of(before, progress), fit_of(after, progress))
        first, other = (session(fit, name) for fit, name in zip(fits, conditions or (None, None), strict=True))
        reasons = why_incomparable(*fits)
        if reasons:
            raise KinertiaError(reasons)
        rows, later = session_features(first, other, share_done)
        outcomes = changes_between(rows.events, later.events, first.fixed_axes or other.fixed_axes)
        curves = curve_changes(rows.curves, later.curves, apart)
        return _comparison(conditions or ("before", "after"), first, other, outcomes, curves)
    if conditions is None:
        raise KinertiaError("give two sessions, or two conditions of one")
    if isinstance(before, Fit) or Path(before).is_dir():
        fit = fit_of(before, progress)
    else:
        fit = fit_subject(before, progress)
    features, condition = condition_features(fit, *conditions, share_done)
    first, other = (session(fit, name) for name in conditions)
    found = changes_of_strides(features.events, masks_of(features.events, condition, *conditions))
    masks = masks_of(features.curves, condition, *conditions)
    early, late = (rows_of(features.curves, mask) for mask in masks)
    return _comparison(conditions, first, other, found, curve_changes(early, late, paired))


def _comparison(
    names: tuple[str, str], first: Session, other: Session, outcomes: Iterable[Change], curves: Iterable[CurveChange]
) -> Comparison:
    """Add speed, steps and doubts about instruments."""
    doubts = instrument_doubts((first.fit, first.trials), (other.fit, other.trials))
    doubt = " ".join(dict.fromkeys(doubts.values()))
    judged = tuple(replace(one, doubt=doubts.get(one.side, "") if one.quantity == "moment" else "") for one in outcomes)
    walks = first.trials, other.trials
    return Comparison(*names, judged, speed_change(*walks), gait_changes(*walks), tuple(curves), doubt)


def fit_of(source: Fit | str | Path, progress: Progress) -> Fit:
    """Return a result: given, loaded from its folder, or estimated from a subject file as one of two sessions."""
    if isinstance(source, Fit):
        return source
    return load_fit(source) if Path(source).is_dir() else fit_session(Path(source), progress)
