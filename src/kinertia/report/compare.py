"""Determines what changed between two sessions or conditions, from files, folders or results: `kinertia.compare`."""

from pathlib import Path

from kinertia.errors import KinertiaError
from kinertia.estimation.condition_changes import Change, changes
from kinertia.estimation.prepared import Progress
from kinertia.estimation.result import Fit
from kinertia.estimation.session_changes import session, session_changes
from kinertia.report.saved_fit import load_fit
from kinertia.workflow.from_files import fit_subject
from kinertia.workflow.session_fit import fit_session


def compare(
    before: Fit | str | Path,
    after: Fit | str | Path | None = None,
    conditions: tuple[str, str] | None = None,
    progress: Progress = lambda stage, share: None,
) -> tuple[Change, ...]:
    """Determine what changed: joint moments and angles, event by event.

    Args:
        before, after: two sessions of one person: subject files, folders of results, or results. Without `after`,
            `conditions` of the first are compared.
        conditions: of the trials before and after, as their `condition` in the subject file.
        progress: called as the work progresses, with a stage's name and the share of it that is done.

    Raises:
        KinertiaError: they cannot be compared; it says why.

    Examples:
        >>> found = kinertia.compare("before/subject.toml", "after/subject.toml")  # doctest: +SKIP
        >>> [one.difference for one in found if one.verdict == "changed"]  # doctest: +SKIP
    """
    if after is not None:
        fits = (fit_of(before, progress), fit_of(after, progress))
        first, other = (session(fit, name) for fit, name in zip(fits, conditions or (None, None), strict=True))
        return session_changes(first, other, lambda share: progress("comparison", share))
    if conditions is None:
        raise KinertiaError("give two sessions, or two conditions of one")
    if isinstance(before, Fit) or Path(before).is_dir():
        fit = fit_of(before, progress)
    else:
        fit = fit_subject(before, progress)
    return changes(fit, *conditions, lambda share: progress("comparison", share))


def fit_of(source: Fit | str | Path, progress: Progress) -> Fit:
    """Return a result: given, loaded from its folder, or estimated from a subject file as one of two sessions."""
    if isinstance(source, Fit):
        return source
    return load_fit(source) if Path(source).is_dir() else fit_session(Path(source), progress)
