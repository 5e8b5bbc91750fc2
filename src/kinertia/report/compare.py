"""Determines what changed between two sessions or conditions, from files, folders or results: `kinertia.compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinertia.errors import KinertiaError
from kinertia.estimation.condition_changes import Change, changes
from kinertia.estimation.prepared import Progress
from kinertia.estimation.result import Fit
from kinertia.estimation.session_changes import session, session_changes
from kinertia.estimation.walking_speed import speed_change
from kinertia.report.changes import change_rows, change_sentences, changed_sentence, changes_summary, speed_sentence
from kinertia.report.rendering import rendered
from kinertia.report.saved_fit import load_fit
from kinertia.workflow.from_files import fit_subject
from kinertia.workflow.session_fit import fit_session


@dataclass(frozen=True)
class Comparison:
    """What changed between two sessions or conditions.

    Attributes:
        before, after: their names.
        outcomes: joint moments and angles, event by event.
        speed: walking speed, which changes moments; None where it is not known.

    Examples:
        >>> found = kinertia.compare("before/subject.toml", "after/subject.toml")  # doctest: +SKIP
        >>> [one.difference for one in found.outcomes if one.verdict == "changed"]  # doctest: +SKIP
    """

    before: str
    after: str
    outcomes: tuple[Change, ...]
    speed: Change | None

    @property
    def sentences(self) -> tuple[str, ...]:
        """Walking speed, each outcome that was named beforehand, and how many of the others changed."""
        return (speed_sentence(self.speed), *change_sentences(self.outcomes), changed_sentence(self.outcomes))

    def shown(self) -> dict[str, Any]:
        """Return what the templates show of it."""
        return {
            "before": self.before,
            "after": self.after,
            "sentences": self.sentences,
            "rows": change_rows(self.outcomes),
        }

    def page(self) -> str:
        """Render the page of conditions of one session."""
        return rendered("changes_page.html.j2", title=f"{self.before} and {self.after}", changes=self.shown())

    @property
    def summary(self) -> dict[str, Any]:
        """What `kinertia compare --json` prints of it."""
        return changes_summary(self.before, self.after, self.outcomes, self.speed)


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
        found = session_changes(first, other, share_done)
        return Comparison(*(conditions or ("before", "after")), found, speed_change(first.trials, other.trials))
    if conditions is None:
        raise KinertiaError("give two sessions, or two conditions of one")
    if isinstance(before, Fit) or Path(before).is_dir():
        fit = fit_of(before, progress)
    else:
        fit = fit_subject(before, progress)
    found = changes(fit, *conditions, share_done)
    first, other = (session(fit, name) for name in conditions)
    return Comparison(*conditions, found, speed_change(first.trials, other.trials))


def fit_of(source: Fit | str | Path, progress: Progress) -> Fit:
    """Return a result: given, loaded from its folder, or estimated from a subject file as one of two sessions."""
    if isinstance(source, Fit):
        return source
    return load_fit(source) if Path(source).is_dir() else fit_session(Path(source), progress)
