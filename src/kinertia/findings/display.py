"""Formats SI quantities for people (mm, ms, degrees, %), and fills them into sentences."""

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kinertia.findings.quantity import Quantity, Where

_FIELD = re.compile(r"\{(\w+)(?::([+%#]*))?\}")
_UNIT_SUFFIX = re.compile(r"_(?:m_s|nm_n|kg_m3|kg|nm|rad|hz|sd|n|m|s)$")
_LISTED = 4


def _scaled(unit: str, size: float) -> tuple[float, str, int]:
    """Return factor, unit and number of decimals for a size in an SI unit."""
    match unit:
        case "m":
            return (1e3, "mm", 0 if size >= 0.01 else 1) if size < 1.0 else (1.0, "m", 2)
        case "s":
            return (1e3, "ms", 0 if size >= 0.02 else 1) if size < 0.3 else (1.0, "s", 2)
        case "rad":
            return 180.0 / np.pi, "degrees", 1
        case "N m/N":
            return 1e3, "N m per kN", 1
        case "N":
            return 1.0, "N", 0 if size >= 10.0 else 1
        case "kg" | "N m" | "kg/m2":
            return 1.0, unit, 1
        case "m/s" | "m/s2":
            return 1.0, unit, 2
        case "kg/m3" | "a":
            return 1.0, "years" if unit == "a" else unit, 0
    return 1.0, "" if unit == "1" else unit, -1


def shown(quantity: Quantity, style: str = "") -> str:
    """Format a quantity with its unit: "-23 N", "4.6 mm", "0.25, 0.31 m"; `style` "+" with its sign, "%" as a
    percentage, "#" as a count.
    """
    if isinstance(quantity.value, str):
        return quantity.value
    values = quantity.value if isinstance(quantity.value, tuple) else (quantity.value,)
    factor, unit, digits = _scaled(quantity.unit, max((abs(value) for value in values), default=0.0))
    sign = "+" if "+" in style else ""
    if "%" in style:
        texts = [f"{100.0 * value:{sign}z.3g}" for value in values]
        unit = "%"
    elif "#" in style:
        texts = [f"{value:{sign}z.0f}" for value in values]
    elif digits < 0:
        texts = [f"{value:{sign}z.3g}" for value in values]
    else:
        texts = [f"{factor * value:{sign}z.{digits}f}" for value in values]
    return f"{', '.join(texts)} {unit}".rstrip()


def exact(value: float | tuple[float, ...], unit: str, style: str = "") -> str:
    """Format a limit, or a range, with up to three digits: "7.5 mm", "0.79 to 0.84"; `style` as in `shown`.

    >>> exact(0.0075, "m"), exact(0.05, "1", "%"), exact((-0.025, 0.025), "s"), exact(5000.0, "kg/m3")
    ('7.5 mm', '5 %', '-25 to 25 ms', '5000 kg/m3')
    """
    values = value if isinstance(value, tuple) else (value,)
    factor, name, _ = _scaled(unit, max(abs(number) for number in values))
    if style == "%":
        factor, name = 100.0, "%"
    texts = (f"{factor * number:{'.0f' if abs(factor * number) >= 1000.0 else '.3g'}}" for number in values)
    return f"{' to '.join(texts)} {name}".rstrip()


def first_few(names: Sequence[str], most: int = _LISTED) -> str:
    """List the first names, and how many more there are."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def filled(template: str, where: Where, evidence: Mapping[str, Quantity]) -> str:
    """Fill a sentence of the catalogue with evidence and places: `{level_n}`, `{share:%}`, `{frames:#}`, `{plate}`."""
    places = _places(where)

    def replacement(match: re.Match[str]) -> str:
        name, style = match.group(1), match.group(2) or ""
        if name in evidence:
            return shown(evidence[name], style)
        return places[name]() if name in places else match.group(0)

    return _FIELD.sub(replacement, template)


def outlined(template: str, mark: str = "<{}>") -> str:
    """Return a sentence of the catalogue as it reads before anything was measured: `<level>` for `{level_n}`.

    Args:
        template: sentence with `{names}` of evidence and places.
        mark: format of a name, with `{}` in its place.

    >>> outlined("Forces of {plate} lag by {delay_s:+}{condition}.")  # what joins a word is an addition
    'Forces of <plate> lag by <delay>.'
    >>> outlined("{action}.")
    'It depends on what was found: see the finding.'
    """
    if template.endswith(".") and _FIELD.fullmatch(template[:-1]):
        return "It depends on what was found: see the finding."
    template = re.sub(r"(?<=[\w}])" + _FIELD.pattern, "", template)
    return _FIELD.sub(lambda field: mark.format(_UNIT_SUFFIX.sub("", field.group(1)).replace("_", " ")), template)


def _places(where: Where) -> dict[str, Callable[[], str]]:
    span = where.span_s or (float("nan"), float("nan"))
    return {
        "file": lambda: where.file or "the file",
        "line": lambda: str(where.line or "?"),
        "trial": lambda: where.trial or "the trial",
        "plate": lambda: plate_text(where.plate),
        "axis": lambda: axis_text(where),
        "marker": lambda: where.markers[0] if where.markers else "a marker",
        "other": lambda: where.markers[1] if len(where.markers) > 1 else "another marker",
        "markers": lambda: first_few(where.markers) if where.markers else "the markers",
        "part": lambda: where.part or "the model",
        "start": lambda: f"{span[0]:.2f} s",
        "end": lambda: f"{span[1]:.2f} s",
    }


def plate_text(name: str | None) -> str:
    """Describe a plate by its name, with "plate" added where the name lacks it: "plate left"."""
    if name is None:
        return "all plates"
    return name if re.search("plate|force|belt|platform", name, re.IGNORECASE) else f"plate {name}"


def axis_text(where: Where) -> str:
    """Describe the axis in the person's direction, and as in the file: "fore-aft (X)"."""
    if where.axis and where.file_axis:
        return f"{where.axis} ({where.file_axis})"
    return where.axis or where.file_axis or "an axis"
