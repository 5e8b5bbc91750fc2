"""Decides which of two recordings that disagree is the odd one, by all others."""

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def odd_ones(first: T, other: T, witnesses: Iterable[tuple[float, float]]) -> tuple[T, ...]:
    """Return the one that most other recordings are farther from; both if there are none, or on a tie.

    Args:
        first, other: the two that disagree.
        witnesses: distances of every further recording from the first and from the other.

    >>> odd_ones("walk 1", "walk 2", [(0.001, 0.02), (0.002, 0.015)])
    ('walk 2',)
    >>> odd_ones("walk 1", "walk 2", [])
    ('walk 1', 'walk 2')
    """
    votes = sum((to_first > to_other) - (to_first < to_other) for to_first, to_other in witnesses)
    return (first, other) if votes == 0 else (first,) if votes > 0 else (other,)
