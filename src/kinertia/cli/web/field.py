"""Describes one entry of a form."""

from dataclasses import dataclass
from typing import Literal, get_args, get_origin


@dataclass(frozen=True)
class Field:
    """One entry of the form.

    Attributes:
        key: its name in the form.
        label, about: description, short and long.
        value: value as the field shows it.
        choices: choices of a field that is not a number or text.
        optional: whether most people leave it empty.
    """

    key: str
    label: str
    about: str
    value: str
    choices: tuple[str, ...]
    optional: bool


def choices_of(annotation: object) -> tuple[str, ...]:
    """Return the possible values of an entry where they are a list."""
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    return next((found for part in get_args(annotation) if (found := choices_of(part))), ())
