"""What does a model lack for a fit: markers, bodies of the feet, markers that trials and model have in common?"""

from collections.abc import Iterator

from kinertia.diagnostics.person_context import PersonContext
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.anatomy import segment_of


def markers_and_feet(context: PersonContext) -> Iterator[Finding]:
    """Report O106 and O107: a model without markers, which only a fit needs (O106), or without a body of a foot
    (O107)."""
    model = context.model
    if model is None:
        return
    if not model.skeleton.markers:
        yield finding("O106", None, Severity.ERROR if context.has_trials else Severity.INFO, count=Quantity(0, "1"))
    for side, foot in (("r", "right foot"), ("l", "left foot")):
        if context.has_trials and not any(segment_of(body) == f"foot_{side}" for body in model.skeleton.segments):
            yield finding("O107", Where(part=foot), expected=Quantity(f"calcn_{side} or foot_{side}"))


def unmatched_markers(context: PersonContext) -> Iterator[Finding]:
    """Report O414: markers of a trial that the model does not have."""
    if context.model is None:
        return
    known = set(context.model.skeleton.labels)
    for trial in context.trials:
        unknown = tuple(label for label in trial.all_markers.labels if label not in known)
        if unknown:
            yield finding("O414", Where(trial=trial.name, markers=unknown), source=Quantity("trial"))
