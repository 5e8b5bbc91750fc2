"""Properties of an OpenSim file's elements as Python values, with the file's defaults; errors name the line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from kinertia.errors import OsimError
from kinertia.io.osim.xml import Element
from kinertia.model.axis_functions import (
    PiecewisePolynomial,
    constant,
    linear,
    piecewise_linear,
    polynomial,
    simm_spline,
)

FUNCTIONS = (
    "Constant",
    "LinearFunction",
    "PolynomialFunction",
    "SimmSpline",
    "PiecewiseLinearFunction",
    "MultiplierFunction",
)


@dataclass(frozen=True)
class Values:
    """Reads properties of elements of one file.

    Attributes:
        path: the file.
        defaults: by tag, the element of the file's <defaults> that stands in for properties left out.
    """

    path: Path
    defaults: Mapping[str, Element]

    def fail(self, element: Element, problem: str) -> NoReturn:
        """Raise OsimError about this element."""
        raise OsimError(self.path, problem, element.line, element.name, element.tag)

    def property(self, element: Element, tag: str) -> Element | None:
        """The element's own property, or that of the file's defaults."""
        own = element.child(tag)
        if own is None and element.tag in self.defaults:
            return self.defaults[element.tag].child(tag)
        return own

    def text(self, element: Element, tag: str) -> str:
        """Text of a property, without blanks around; empty where it is left out."""
        entry = self.property(element, tag)
        return "" if entry is None else entry.text.strip()

    def flag(self, element: Element, tag: str, otherwise: bool) -> bool:
        """A true or false."""
        text = self.text(element, tag).lower()
        if text not in ("true", "false", ""):
            self.fail(element, f"{tag} of '{element.name}' is '{text}'; expected true or false")
        return otherwise if text == "" else text == "true"

    def numbers(self, element: Element, tag: str, count: int, otherwise: list[float] | None = None) -> np.ndarray:
        """`count` finite numbers; `otherwise` where the property is left out."""
        entry = self.property(element, tag)
        if entry is None:
            if otherwise is None:
                self.fail(element, f"{element.tag} '{element.name}' has no {tag}; expected {count} number(s)")
            return np.array(otherwise)
        values = self._list(entry, element.name)
        if len(values) != count:
            self.fail(entry, f"{tag} of '{element.name}' has {len(values)} numbers; expected {count}")
        return values

    def _list(self, element: Element, owner: str) -> np.ndarray:
        try:
            values = np.array([float(word) for word in element.text.split()])
        except ValueError:
            self.fail(element, f"{element.tag} of '{owner}' is '{element.text.strip()[:60]}'; expected numbers")
        if not np.isfinite(values).all():
            self.fail(element, f"{element.tag} of '{owner}' is not finite; expected finite numbers")
        return values

    def function(self, element: Element, owner: str) -> PiecewisePolynomial:
        """A function of one coordinate.

        Args:
            element: of the function itself.
            owner: the joint or constraint, for messages.
        """
        if element.tag == "MultiplierFunction":
            holder = element.child("function")
            inner = holder.children[0] if holder is not None and holder.children else None
            if inner is None:
                self.fail(element, f"the MultiplierFunction of '{owner}' multiplies nothing; expected a function in it")
            return self.function(inner, owner).scaled(self.numbers(element, "scale", 1, [1.0])[0])
        if element.tag == "Constant":
            return constant(self.numbers(element, "value", 1, [0.0])[0])
        if element.tag in ("LinearFunction", "PolynomialFunction"):
            return self._of_coefficients(element, owner)
        if element.tag in ("SimmSpline", "PiecewiseLinearFunction"):
            return self._of_points(element, owner)
        self.fail(
            element,
            f"'{owner}' moves by a {element.tag}, which Kinertia does not know; it knows {', '.join(FUNCTIONS)}: "
            f"fit one of them to it",
        )

    def _of_coefficients(self, element: Element, owner: str) -> PiecewisePolynomial:
        entry = self.property(element, "coefficients")
        values = self._list(entry, owner) if entry is not None else np.array([1.0, 0.0])
        if element.tag == "LinearFunction":
            if len(values) != 2:
                self.fail(
                    element,
                    f"the LinearFunction of '{owner}' has {len(values)} coefficients; expected two (one variable)",
                )
            return linear(*values)
        if not len(values):
            self.fail(element, f"the PolynomialFunction of '{owner}' has no coefficients")
        return polynomial(values)

    def _of_points(self, element: Element, owner: str) -> PiecewisePolynomial:
        x, y = element.child("x"), element.child("y")
        if x is None or y is None:
            self.fail(element, f"the {element.tag} of '{owner}' has no x or no y")
        build = simm_spline if element.tag == "SimmSpline" else piecewise_linear
        try:
            return build(self._list(x, owner), self._list(y, owner))
        except ValueError as error:
            self.fail(element, f"the {element.tag} of '{owner}': {error}")
