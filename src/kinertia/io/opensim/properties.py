"""Reads properties of an OpenSim file's elements as Python values, with defaults; errors name the line."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from kinertia.errors import OsimError
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.io.opensim.xml import Element
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
    """Reader of properties of elements of one file.

    Attributes:
        path: the file.
        defaults: by tag, the element of the file's <defaults> that supplies properties left out.
    """

    path: Path
    defaults: Mapping[str, Element]

    def fail(self, element: Element, problem: str, code: str = "O102", owner: str | None = None) -> NoReturn:
        """Raise OsimError about this element.

        Args:
            element: the element in the file.
            problem: what is wrong, and what is expected.
            code: code of the rule; by default that of an unsupported element.
            owner: name of the owner of the element, if it has none itself.
        """
        name = element.name if owner is None else owner
        stated = {"element": Quantity(name), "kind": Quantity(element.tag), "problem": Quantity(problem)}
        raise OsimError.about(self.path, with_evidence(code, Where(part=name or None), stated), element.line)

    def property(self, element: Element, tag: str) -> Element | None:
        """Return the element's own property, or the one in the file's defaults."""
        own = element.child(tag)
        if own is None and element.tag in self.defaults:
            return self.defaults[element.tag].child(tag)
        return own

    def text(self, element: Element, tag: str) -> str:
        """Read the text of a property, without surrounding blanks; empty where it is left out."""
        entry = self.property(element, tag)
        return "" if entry is None else entry.text.strip()

    def flag(self, element: Element, tag: str, otherwise: bool) -> bool:
        """Read a boolean; `otherwise` where the property is left out."""
        text = self.text(element, tag).lower()
        if text not in ("true", "false", ""):
            self.fail(element, f"{tag} is '{text}', expected true or false")
        return otherwise if text == "" else text == "true"

    def numbers(self, element: Element, tag: str, count: int, otherwise: list[float] | None = None) -> np.ndarray:
        """Read `count` finite numbers; `otherwise` where the property is left out."""
        entry = self.property(element, tag)
        if entry is None:
            if otherwise is None:
                self.fail(element, f"it has no {tag}, expected {count} number(s)")
            return np.array(otherwise)
        values = self._list(entry, element.name)
        if len(values) != count:
            self.fail(entry, f"it has {len(values)} numbers, expected {count}", owner=element.name)
        return values

    def _list(self, element: Element, owner: str) -> np.ndarray:
        try:
            values = np.array([float(word) for word in element.text.split()])
        except ValueError:
            self.fail(element, f"it is '{element.text.strip()[:60]}', expected numbers", owner=owner)
        if not np.isfinite(values).all():
            self.fail(element, "expected finite numbers", owner=owner)
        return values

    def function(self, element: Element, owner: str) -> PiecewisePolynomial:
        """Read a function of one coordinate.

        Args:
            element: element of the function itself.
            owner: the joint or constraint, for messages.
        """
        if element.tag == "MultiplierFunction":
            holder = element.child("function")
            inner = holder.children[0] if holder is not None and holder.children else None
            if inner is None:
                self.fail(element, "it multiplies nothing, expected a function in it", owner=owner)
            return self.function(inner, owner).scaled(self.numbers(element, "scale", 1, [1.0])[0])
        if element.tag == "Constant":
            return constant(self.numbers(element, "value", 1, [0.0])[0])
        if element.tag in ("LinearFunction", "PolynomialFunction"):
            return self._of_coefficients(element, owner)
        if element.tag in ("SimmSpline", "PiecewiseLinearFunction"):
            return self._of_points(element, owner)
        self.fail(element, f"this function is unknown, fit one of {', '.join(FUNCTIONS)} to it", owner=owner)

    def _of_coefficients(self, element: Element, owner: str) -> PiecewisePolynomial:
        entry = self.property(element, "coefficients")
        values = self._list(entry, owner) if entry is not None else np.array([1.0, 0.0])
        if element.tag == "LinearFunction":
            if len(values) != 2:
                self.fail(element, f"it has {len(values)} coefficients, expected two (one variable)", owner=owner)
            return linear(*values)
        if not len(values):
            self.fail(element, "it has no coefficients", owner=owner)
        return polynomial(values)

    def _of_points(self, element: Element, owner: str) -> PiecewisePolynomial:
        x, y = element.child("x"), element.child("y")
        if x is None or y is None:
            self.fail(element, "it has no x or no y", owner=owner)
        build = simm_spline if element.tag == "SimmSpline" else piecewise_linear
        try:
            return build(self._list(x, owner), self._list(y, owner))
        except ValueError as error:
            self.fail(element, str(error), owner=owner)
