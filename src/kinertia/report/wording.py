"""Words starting points and numbers for the report."""

import math
from dataclasses import dataclass

from kinertia.estimation.prepared import Prepared
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import Asymmetry
from kinertia.model.bsp import PARAMETERS, UNITS

INTERVAL_SD = 1.96
"""Half of a 95 % interval, in standard deviations."""
USUAL = "usual pipeline"
"""Inverse kinematics, filtered, and forces as measured."""
_READ_IN = {"m": ("mm", 1e3)}
_DECIMALS = {"kg": 2, "m": 1}
_INERTIA_DECIMALS = (4, 6)


@dataclass(frozen=True)
class Start:
    """Names of the body segment parameters before the estimate.

    Attributes:
        word: name in headings and legends.
        phrase: name in sentences.
        values: name of the stage of residuals and moments.
    """

    word: str
    phrase: str
    values: str


LITERATURE = Start("literature", "the literature", "literature values")
MODEL = Start("model", "the model", "the model's own values")
PRIOR = Start("prior", "the prior", "prior values")


def start_of(person: Fit | Prepared) -> Start:
    """Return the names of the starting parameters: an OpenSim model's own, the literature's for the built-in one."""
    return LITERATURE if person.file is None else MODEL


def expected_of(fit: Fit) -> Start:
    """Return the names of the prior's mean: "prior" where more is known about a person than the starting values."""
    return PRIOR if fit.more_known else start_of(fit)


def read_in(k: int) -> tuple[str, float]:
    """Return the displayed unit of parameter k of `PARAMETERS` (kg, mm, kg m2), and the factor to it."""
    return _READ_IN.get(UNITS[k], (UNITS[k], 1.0))


def decimals(k: int, size: float) -> int:
    """Return decimals of parameter k: 2 for kg, 1 for mm; for kg m2 two digits of `size`, the SD, but at least 4."""
    if UNITS[k] in _DECIMALS:
        return _DECIMALS[UNITS[k]]
    least, most = _INERTIA_DECIMALS
    return least if size <= 0 else min(max(1 - math.floor(math.log10(size)), least), most)


def fixed(value: float, digits: int, sign: bool = False) -> str:
    """Format a number with this many decimals; a value that rounds to zero has no sign."""
    text = f"{value:+.{digits}f}" if sign else f"{value:.{digits}f}"
    return text if float(text) else text.lstrip("+-")


def asymmetry_sentences(fit: Fit) -> list[str]:
    """State for each pair of limbs whether left and right differ beyond their error bars; nothing after two-level."""
    pairs = fit.asymmetries
    alike = [_said(pair.segment) for pair in pairs if not pair.differing]
    differing = [f"{_said(pair.segment)}: {_differences(pair)}" for pair in pairs if pair.differing]
    return [*differing, *([f"no difference beyond the error bars: {', '.join(alike)}"] if alike else [])]


def _said(segment: str) -> str:
    return segment.replace("_", " ")


def _differences(pair: Asymmetry) -> str:
    """List the parameters that differ, right minus left."""
    parts = []
    for k in pair.differing:
        unit, factor = read_in(k)
        value, sd = factor * pair.difference[k], factor * pair.sd[k]
        digits = decimals(k, sd)
        parts.append(
            f"{PARAMETERS[k]} of the right {fixed(value, digits, sign=True)} ± {fixed(sd, digits)} {unit} (sd)"
        )
    return ", ".join(parts)
