"""Collects what is known about this person's body besides the tables: measured segments, an earlier session.

An earlier estimate replaces the values and SDs of the literature, but not its correlations, since a table of SDs has
none. Measured parameters are then added as measurements with errors: the mean moves towards them according to their
precision, and correlated parameters (of the other side, or the trunk that a thigh is cut from) move with them.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kinertia.errors import PriorError
from kinertia.estimation.body_measures import with_measures
from kinertia.estimation.learnt_prior import LearntPrior
from kinertia.estimation.prepared import KNOWN_BODY_SD, Prepared, body_sd_kg
from kinertia.estimation.prepared import known as known_value
from kinertia.estimation.prior import BspPrior, literature_prior, updated, with_symmetry
from kinertia.findings.display import shown
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.subject.body_files import BodyMeasures, BspTable
from kinertia.model.bsp import PARAMETERS, UNITS, BodySegmentParameters
from kinertia.model.stadium_body import measures as all_measures
from kinertia.settings import Attached, KnownSegment, PriorSettings

_PROSTHESIS_MASS_SD, _PROSTHESIS_SPREAD = 0.4, 3.0
"""Relative SD of a prosthesis' mass, and the factor on the tables' other SDs."""
_KEPT_SHARE = 1e-3
"""SD of a fixed mass, over its prior's."""


@dataclass(frozen=True, eq=False)
class KnownBody:
    """What is known of a person's body besides mass, height and sex.

    Attributes:
        settings: settings of the prior.
        earlier: an earlier estimate with SDs, in place of the literature's.
        segments: measured parameters by segment.
        group: prior learnt from the person's group, in place of the literature's.
        measures: girths and lengths of the person.
    """

    settings: PriorSettings
    earlier: BspTable | None = None
    segments: Mapping[str, KnownSegment] = field(default_factory=dict)
    group: LearntPrior | None = None
    measures: BodyMeasures | None = None

    def leaned_on(self, ready: Prepared) -> tuple[Prepared, Collection[str]]:
        """Return the person with the prior before measurements, and segments whose masses are not tied to body mass.

        Args:
            ready: the person with the literature's prior, of the body alone.

        Raises:
            PriorError: both an earlier estimate and a group, a segment that the model lacks, or either is of another
                model.
        """
        prior, found = ready.prior, list(ready.findings)
        if self.group is not None:
            if self.earlier is not None:
                raise PriorError("[prior] has both bsp and population; the person's own estimate says more: keep bsp")
            if ready.file is not None:
                raise PriorError("[prior] population is for the built-in model; OpenSim models have other segments")
            prior = replace(self.group.of(literature_prior(ready.literature)), mass_sd_kg=prior.mass_sd_kg)
            found.append(_leans_on(f"learnt from {self.group.people} people in place of the literature's"))
        if self.earlier is not None:
            prior = _from_earlier(prior, self.earlier)
            found.append(_leans_on(f"{self.earlier.name} in place of the literature; it must not include these trials"))
        if self.settings.sides_correlation is not None:
            covariance = with_symmetry(prior.covariance, prior.mean.segments, self.settings.sides_correlation)
            prior = replace(prior, covariance=covariance)
        artificial = [name for name, known in self.segments.items() if known.prosthesis]
        for name in artificial:
            prior = with_prosthesis(prior, name)
            found.append(
                _leans_on(f"{name} is a declared prosthesis: neither reference data nor symmetry is used for it")
            )
        by_itself = artificial if self.earlier is None else prior.mean.segments
        return replace(ready, prior=prior, findings=tuple(found)), by_itself

    def measured_on(self, ready: Prepared) -> Prepared:
        """Update the prior of the body, and what is attached to it, with measurements.

        Raises:
            PriorError: a segment that the model lacks, or measures that cannot be used.
        """
        prior, found = ready.prior, list(ready.findings)
        if self.measures is not None:
            prior, more = _with_measures(ready, prior, self.segments, self.measures)
            found += more
        measured = _measured(prior, self.segments)
        for (row, column), (value, sd) in measured.items():
            k = 10 * row + column
            segment, parameter = prior.mean.segments[row], PARAMETERS[column]
            expected, expected_sd = prior.mean.table().ravel()[k], float(np.sqrt(prior.covariance[k, k]))
            unit = UNITS[column]
            stated = Quantity(value, unit, sd=sd)
            source = self.segments[segment].source or "no source given"
            found.append(_leans_on(f"{segment} {parameter}, {shown(stated)} +- {sd:.2g} ({source})"))
            distance = abs(value - expected) / float(np.hypot(expected_sd, sd))
            if distance > KNOWN_BODY_SD:
                found.append(
                    finding(
                        "S402",
                        Where(part=f"{segment} {parameter}"),
                        distance_sd=Quantity(distance, "1", limit=KNOWN_BODY_SD),
                        stated=stated,
                        expected=Quantity(float(expected), unit, sd=expected_sd),
                    )
                )
        if self.settings.masses_kept:
            kept = _kept(prior, len(prior.mean.segments) - len(ready.attached), ready.attached)
            measured = {**kept, **measured}
            found.append(_leans_on("masses kept as they are"))
        return replace(ready, prior=_given(prior, measured), findings=tuple(found))


def _leans_on(source: str) -> Finding:
    """Return S408, which states the source of the prior."""
    return finding("S408", source=Quantity(source))


def _kept(prior: BspPrior, body: int, attached: Sequence[Attached]) -> dict[tuple[int, int], tuple[float, float]]:
    """Return masses and SDs of the body's (first) segments for masses that are to be kept, as `_measured` does."""
    if unknown := [item.name for item in attached if item.mass_kg is None and item.on_scale]:
        raise PriorError(
            f"masses_kept = true under [prior], but {unknown[0]}, of unknown mass, was weighed with the person, so "
            "that the body's masses are not known either; weigh one of the two alone, or leave masses_kept out"
        )
    masses = zip(prior.mean.mass_kg[:body].tolist(), prior.sd[:body, 0].tolist(), strict=True)
    return {(k, 0): (mass, _KEPT_SHARE * share) for k, (mass, share) in enumerate(masses)}


def _with_measures(
    ready: Prepared,
    prior: BspPrior,
    segments: Mapping[str, KnownSegment],
    measures: BodyMeasures,
) -> tuple[BspPrior, list[Finding]]:
    """Return the prior updated by girths and lengths, and the findings about them."""
    if ready.file is not None:
        raise PriorError("[prior] measures are for the built-in model; OpenSim models divide the body differently")
    body_kg, height_m = ready.total_mass.body_kg, known_value(ready.subject.height_m)
    artificial = [name for name, known in segments.items() if known.prosthesis]
    body_sd = body_sd_kg(known_value(ready.subject.mass_kg), ready.attached)
    prior, body = with_measures(prior, ready.skeleton, measures.values, body_kg, height_m, artificial, body_sd)
    found = [
        _leans_on(f"{len(measures.values)} of {len(all_measures())} girths and lengths from {measures.name}"),
        *(reported.in_file(measures.name) for reported in body.findings),
    ]
    if abs(body.total_kg - body_kg) > KNOWN_BODY_SD * np.hypot(body.total_sd_kg, body_sd):
        yeadon = Quantity(body.total_kg, "kg", sd=body.total_sd_kg)
        found.append(finding("S404", Where(file=measures.name), yeadon_kg=yeadon, stated_kg=Quantity(body_kg, "kg")))
    return prior, found


def _from_earlier(prior: BspPrior, earlier: BspTable) -> BspPrior:
    """Return the prior with mean and SDs of an earlier estimate; fixed parameters keep the prior's own."""
    names = prior.mean.segments
    if missing := [name for name in names if name not in earlier.segments]:
        raise PriorError(
            f"{earlier.name} has no {', '.join(missing)}; it has {', '.join(earlier.segments)}: was it estimated with "
            "another model?"
        )
    rows = [earlier.segments.index(name) for name in names]
    held = ~earlier.sd[rows].any(axis=1, keepdims=True)
    prior_sd = prior.sd.ravel()
    sd = np.where(held, prior.sd, earlier.sd[rows]).ravel()
    return replace(
        prior,
        mean=BodySegmentParameters.from_table(names, np.where(held, prior.mean.table(), earlier.estimate[rows])),
        covariance=prior.covariance / np.outer(prior_sd, prior_sd) * np.outer(sd, sd),
    )


def with_prosthesis(prior: BspPrior, segment: str) -> BspPrior:
    """Return the prior of a prosthetic segment: wide, and independent of all others.

    The side of a below-knee prosthesis is often some 2 kg lighter than the other (Smith & Martin 2011, J Prosthet
    Orthot 23:114), which is 40 % of shank and foot; its centre of mass is further up by an amount for which there are
    no numbers.
    """
    row = _row(prior, segment)
    rows = slice(10 * row, 10 * row + 10)
    factor = np.full(10, _PROSTHESIS_SPREAD)
    factor[0] = max(_PROSTHESIS_MASS_SD * prior.mean.mass_kg[row] / prior.sd[row, 0], 1.0)
    covariance = prior.covariance.copy()
    widened = covariance[rows, rows] * np.outer(factor, factor)
    covariance[rows, :] = covariance[:, rows] = 0.0
    covariance[rows, rows] = widened
    return replace(prior, covariance=covariance)


def _row(prior: BspPrior, segment: str) -> int:
    if segment not in prior.mean.segments:
        raise PriorError(f"[segment.{segment}]: the model has no such segment; it has {', '.join(prior.mean.segments)}")
    return prior.mean.segments.index(segment)


def _measured(prior: BspPrior, segments: Mapping[str, KnownSegment]) -> dict[tuple[int, int], tuple[float, float]]:
    """Return value and SD (SI) of measured parameters, by row and column of the table."""
    result = {}
    for name, known in segments.items():
        row = _row(prior, name)
        for parameter, (value, sd) in known.parameters().items():
            result[row, PARAMETERS.index(parameter)] = value, sd
    return result


def _given(prior: BspPrior, measured: Mapping[tuple[int, int], tuple[float, float]]) -> BspPrior:
    """Condition the prior on these measured parameters."""
    if not measured:
        return prior
    at = [10 * row + column for row, column in measured]
    values, sd = np.array(list(measured.values())).T
    seen = np.eye(prior.mean.table().size)[at]
    table, covariance = updated(prior.mean.table().ravel(), prior.covariance, seen, values, np.diag(np.square(sd)))
    mean = BodySegmentParameters.from_table(prior.mean.segments, table)
    return replace(prior, mean=mean, covariance=covariance)
