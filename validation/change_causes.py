"""Measures what errors of a day's angles and moments come from, on synthetic people: one source put in at a time.

The error due to a source is the error of a day with that source alone, minus that of a day without any. Moments are of
the true body, as those of two days are of one body; what the estimate's own body makes up for does not cancel between
days.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kinertia.estimation.changes.stride_features import only, stride_features
from kinertia.estimation.result.drawn_fit import kept_draws
from kinertia.estimation.result.fit import Fit
from kinertia.model.bsp import BodySegmentParameters
from kinertia.synthetic.walk import Manner
from validation.change_people import PUT_IN, Person, changed, day, drawn_subject, in_words
from validation.measured_trials import table

TOGETHER, WITHOUT = "together", "without"
Errors = Mapping[str, Mapping[str, float]]
"""By what was put in, and by outcome."""


def errors_by_source(seed: int) -> list[Errors]:
    """Return the errors of a person's first and third day with each of PUT_IN alone, with all, and with none."""
    subject = drawn_subject(np.random.default_rng(seed))
    cases = {TOGETHER: PUT_IN, WITHOUT: (), **{source: (source,) for source in PUT_IN}}
    found: list[Errors] = []
    for number, manner in ((1, Manner()), (3, changed())):
        errors = {}
        for case, put_in in cases.items():
            measured = day(subject, manner, str(number), np.random.default_rng([seed, number]), put_in)
            means = _with_body(measured.fit, subject.bsp)
            errors[case] = {name: mean - measured.truth[name] for name, mean in means.items() if name in measured.truth}
        found.append(errors)
    return found


def _with_body(fit: Fit, body: BodySegmentParameters) -> dict[str, float]:
    """Return the mean of each outcome over the strides of a fit, with this body in place of the estimated one."""
    draws, rows = only(kept_draws(fit), body=True), [body.segments.index(name) for name in kept_draws(fit).segments]
    locked = np.array([[fit.skeleton.locked[name] for name in draws.coordinates]])
    centre = replace(draws, bsp=body.table()[None, rows], coordinate_values=locked)
    events = stride_features(fit, fit.trials, {}, 0, centre=centre).events
    values = defaultdict(list)
    for (_, name, side, _), value in zip(events.keys, events.estimate, strict=True):
        values[in_words(name, side)].append(float(value))
    return {name: float(np.mean(some)) for name, some in values.items()}


def causes_table(days: Sequence[Errors], people: Sequence[Person], components: Sequence[str]) -> str:
    """Return RMS errors of a day by component and source, beside the deviation that is stated of a day."""
    stated = defaultdict(list)
    for change in (judged.change for person in people for judged in person.judged(1)):
        stated[f"{change.quantity} {change.joint} {change.component}"].append(change.sd**2 / 2.0)
    squares: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for errors in days:
        for name in set.intersection(*(set(of_case) for of_case in errors.values())):
            component = " ".join(name.split(" ")[:3])
            for case, of_case in errors.items():
                less = errors[WITHOUT][name] if case in PUT_IN else 0.0
                squares[component][case].append((of_case[name] - less) ** 2)
    heads = ["component", "stated", TOGETHER, *PUT_IN, WITHOUT]
    rows = []
    for name in components:
        digits = 3 if name.startswith("moment") else 1
        columns = [stated[name], *(squares[name][case] for case in heads[2:])]
        rows.append([name, *(f"{np.sqrt(np.mean(column)):.{digits}f}" for column in columns)])
    return table(heads, rows)
