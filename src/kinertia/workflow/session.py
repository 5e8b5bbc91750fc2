"""Combines the information from several people's trials on a session's plates and synchronisation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.result.corrections import session_contradictions
from kinertia.errors import SessionError
from kinertia.estimation.prepared import Prepared
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.instruments.instrument_errors import (
    CalibrationEntry,
    item_text,
    laboratory_errors,
    quantity_text,
)
from kinertia.estimation.simultaneous.instruments.plates import PLATE_ERRORS, plates_with_floor
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.io.subject.learnt_files import PersonInstruments
from kinertia.settings import Instruments


@dataclass(frozen=True)
class SessionInstruments:
    """Instrument errors of a session, from the trials of all its people.

    Attributes:
        people: information from each person's trials.
        errors: errors of plates and synchronisation.
        contradictions: errors in which a person's trials differ from the others' (S501).
    """

    people: tuple[PersonInstruments, ...]
    errors: tuple[CalibrationEntry, ...]
    contradictions: tuple[Finding, ...] = ()

    @property
    def found(self) -> dict[str, dict[str, tuple[float, float, str]]]:
        """Error, SD and unit by instrument and quantity, in words and units for people."""
        found: dict[str, dict[str, tuple[float, float, str]]] = {}
        for error in self.errors:
            of_item = found.setdefault(item_text(error.kind, error.plate), {})
            of_item[quantity_text(error.quantity, error.axis)] = error.value, error.sd, error.unit
        return found


def person_instruments(fit: Fit, files: Sequence[str]) -> PersonInstruments:
    """Return the information of a fit on plates and synchronisation, for others of the session.

    Args:
        fit: a fit by the simultaneous estimate.
        files: SHA-256 of every file that the fit is from.

    Raises:
        SessionError: the fit is by the two-level estimate, which takes instruments as exact.
    """
    if fit.posterior is None:
        problem = 'the two-level estimate assumes exact plates and synchronisation; use method = "simultaneous"'
        raise SessionError(f"{fit.subject.name}: {problem}")
    shown = fit.posterior.instruments
    return PersonInstruments(
        name=fit.subject.name,
        files=tuple(files),
        plates=shown.plates,
        information=tuple(map(tuple, shown.information.tolist())),
        rhs=tuple(shown.rhs.tolist()),
    )


def session_instruments(people: Sequence[PersonInstruments], stated: Instruments) -> SessionInstruments:
    """Combine the information of all people of a session, under what the laboratory states."""
    apart: list[Finding] = []
    # of two, one contradicts the other
    for person in people if len(people) > 2 else people[: len(people) - 1]:
        rest = _errors([other for other in people if other is not person], stated)
        apart += session_contradictions(person.name, _errors([person], stated), rest)
    return SessionInstruments(tuple(people), _errors(people, stated), tuple(apart))


def _errors(people: Sequence[PersonInstruments], stated: Instruments) -> tuple[CalibrationEntry, ...]:
    plates = tuple(dict.fromkeys(name for person in people for name in person.plates))
    prior = InstrumentPrior.stated(stated, _informations(people))
    shown, unknowns = prior.of_session(plates), prior.of_unknowns(plates)
    after = GaussianPrior.given(unknowns, shown.information, shown.rhs)
    covariance = np.linalg.inv(shown.information + after.precision)
    mean = covariance @ (shown.rhs + after.pull)
    # a foot stands on the sum of plate error and common offset
    to_plates, per_plate = plates_with_floor(len(plates)), len(PLATE_ERRORS)
    values = to_plates @ mean[:-1]
    sd = np.sqrt(np.diag(to_plates @ covariance[:-1, :-1] @ to_plates.T))
    rows = zip(values.reshape(-1, per_plate), sd.reshape(-1, per_plate), strict=True)
    delay_s = float(mean[-1]), float(np.sqrt(covariance[-1, -1]))
    solved = laboratory_errors(dict(zip(plates, rows, strict=True)), delay_s, prior)
    return tuple(error.entry for error in solved)


def with_instruments(
    ready: Prepared, stated: Instruments, session: Sequence[PersonInstruments] = (), files: Sequence[str] = ()
) -> Prepared:
    """Return a prepared person with instrument priors from the laboratory's statements and the session's other people.

    Args:
        ready: the person with the literature's SDs.
        stated: statements of the laboratory.
        session: information from people measured with the same instruments.
        files: SHA-256 of this person's files: people who share one are the same person and are left out.

    Raises:
        SessionError: none of the others stood on any of this person's plates.
    """
    others = [person for person in session if not set(person.files) & set(files)]
    of_person = {plate for k in ready.kinematics for plate in k.trial.loads.plates}
    theirs = {name for person in others for name in person.plates}
    if others and not of_person & theirs:
        raise SessionError(
            f"none of the session's plates ({', '.join(sorted(theirs))}) is among this person's "
            f"({', '.join(sorted(of_person))}); plates are matched by name"
        )
    feet = ready.uncertainty.instruments.feet
    prior = replace(InstrumentPrior.stated(stated, _informations(others)), feet=feet)
    findings = ready.findings
    if session:
        left_out = [person.name for person in session if person not in others]
        source = (
            f"plates and synchronisation are known from {_listed([fits[0].name for fits in _persons(others)])}"
            if others
            else "nothing of others"
        )
        own_trials = f"; {_listed(left_out)} left out: the same files are in this fit" if left_out else ""
        findings = (*findings, finding("S408", source=Quantity(f"session: {source}{own_trials}")))
    return replace(ready, uncertainty=replace(ready.uncertainty, instruments=prior), findings=findings)


def _listed(names: Sequence[str]) -> str:
    return f"{len(names)} {'person' if len(names) == 1 else 'people'} ({', '.join(names)})"


def _persons(people: Sequence[PersonInstruments]) -> list[list[PersonInstruments]]:
    """Group results by person: those that share a file are fits of one person's trials."""
    persons: list[list[PersonInstruments]] = []
    for person in people:
        same = [fits for fits in persons if any(set(person.files) & set(other.files) for other in fits)]
        persons = [fits for fits in persons if fits not in same] + [[*(fit for fits in same for fit in fits), person]]
    return persons


def _informations(people: Sequence[PersonInstruments]) -> list[InstrumentInformation]:
    """Return the information of each person."""
    return [InstrumentInformation.of_one_person([_information(fit) for fit in fits]) for fits in _persons(people)]


def _information(person: PersonInstruments) -> InstrumentInformation:
    return InstrumentInformation(person.plates, np.array(person.information), np.array(person.rhs))
