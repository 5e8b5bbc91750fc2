"""S50, was everybody of a session measured with the same instruments?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeAlias

import numpy as np

from kinertia.estimation.simultaneous.instrument_errors import InstrumentError
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

InstrumentValues: TypeAlias = Mapping[str, Mapping[str, tuple[float, float, str]]]
"""Instrument -> quantity -> value as an estimate applies it, SD and unit."""
_APART_SD = 3.0


def session_contradictions(person: str, own: InstrumentValues, others: InstrumentValues) -> Iterator[Finding]:
    """S501 of everything that one person's trials and those of the others find different.

    Args:
        person: name.
        own, others: what their trials find of each instrument.
    """
    for instrument, quantities in own.items():
        for quantity, (value, sd, unit) in quantities.items():
            other, other_sd, _ = others.get(instrument, {}).get(quantity, (value, sd, unit))
            apart_sd = float(np.hypot(sd, other_sd))
            if abs(value - other) > _APART_SD * apart_sd:
                yield finding(
                    "S501",
                    Where(plate=instrument, part=f"{quantity} by {person}"),
                    error=Quantity(_error(quantity, value, sd, unit), unit, sd=sd),
                    other_error=Quantity(_error(quantity, other, other_sd, unit), unit, sd=other_sd),
                    sd=Quantity(apart_sd, unit, limit=_APART_SD * apart_sd),
                    person=Quantity(person),
                    instrument=Quantity(f"{instrument}: {quantity}"),
                )


def _error(quantity: str, value: float, sd: float, unit: str) -> float:
    return InstrumentError("", quantity, None, None, value, sd, sd, unit).error
