"""Writes and reads what is learnt from other fits: a group (`population`), plates of a session (`instruments`).

The top lists, for readers, what was learnt about each parameter. Below are mean and covariance in relative parameters,
and the files that they are from, so that no recordings count twice.

The top lists, for readers, what was found from all trials together. Below is the information from each person's trials
(inverse covariance and right-hand side), so that a fit can add the others' information without its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import AliasChoices, Field, ValidationError, model_validator

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.text.toml_lines import read_toml
from kinertia.model.bsp import PARAMETERS
from kinertia.settings import Table

Numbers = Annotated[tuple[float, ...], Field(strict=False)]
_DIGITS = 13
_UNITS = {
    "m": ("mm", 1e3),
    "1": ("percent", 1e2),
    "N m/N": ("Nm_per_kN", 1e3),
    "rad": ("degrees", 180.0 / math.pi),
    "s": ("ms", 1e3),
}
"""Name and factor of the unit in which people read a value."""


class PopulationFile(Table):
    """Content of a whole population file.

    Attributes:
        kinertia: version of Kinertia.
        people: names of the people.
        files: SHA-256 of all files that it was learnt from.
        segments: names of the segments.
        mean, mean_sd: (10 s,) mean of the group in the literature's SDs, and its own SD.
        covariance: (10 s, 10 s) covariance of one more person of the group.

    Examples:
        >>> from kinertia.io.subject.learnt_files import PopulationFile
        >>> zeros = (0.0,) * 10
        >>> made = dict(mean=zeros, mean_sd=zeros, covariance=(zeros,) * 10)
        >>> PopulationFile(kinertia="0.1", people=("A",), files=("9f",), segments=("leg",), **made).segments
        ('leg',)
    """

    kinertia: str
    people: tuple[str, ...] = Field(strict=False)
    files: tuple[str, ...] = Field(strict=False)
    segments: tuple[str, ...] = Field(strict=False)
    mean: Numbers
    mean_sd: Numbers
    covariance: tuple[Numbers, ...] = Field(strict=False)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        size = len(PARAMETERS) * len(self.segments)
        if {len(self.mean), len(self.mean_sd), len(self.covariance), *map(len, self.covariance)} != {size}:
            raise ValueError(f"mean and covariance must have {size} rows and columns for {len(self.segments)} segments")
        if np.linalg.eigvalsh(np.array(self.covariance))[0] <= 0:
            raise ValueError("the covariance is not positive definite")
        return self


def read_population(path: Path) -> PopulationFile:
    """Read what was learnt from a group.

    Raises:
        FileError: no such file, or not one that `kinertia population` wrote; with the line.
    """
    document = read_toml(path, "a file of kinertia population (population.toml)")
    try:
        return PopulationFile.model_validate(document.content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "its numbers"
        line = document.line(first["loc"]) or document.last_line
        evidence = {"entry": Quantity(place), "problem": Quantity(f"{place}: {first['msg']}")}
        raise FileError.found(path, "F185", line, **evidence) from None


def population_text(population: PopulationFile) -> str:
    """Return the text of the file."""
    lines = [
        f"# {len(population.people)} people of a group, learnt by kinertia population. For the fits of others of it:",
        "#     [prior]",
        '#     population = "population.toml"',
        "# Mean (+- how well it is known) and spread within the group, relative to the literature, in its SDs:",
    ]
    spread = np.sqrt(np.diag(np.array(population.covariance)))
    names = [f"{segment} {parameter}" for segment in population.segments for parameter in PARAMETERS]
    lines += [
        f"# {name:20s} {mean:+6.2f} +- {sd:4.2f}   {body_sd:4.2f}"
        for name, mean, sd, body_sd in zip(names, population.mean, population.mean_sd, spread.tolist(), strict=True)
    ]
    lines += ["", f"kinertia = {json.dumps(population.kinertia)}"]
    lines += [
        f"people = {json.dumps(population.people, ensure_ascii=False)}",
        f"files = {json.dumps(population.files)}",
    ]
    lines += [f"segments = {json.dumps(population.segments)}", f"mean = {_numbers(population.mean)}"]
    lines += [f"mean_sd = {_numbers(population.mean_sd)}"]
    rows = ",\n".join(f"    {_numbers(row)}" for row in population.covariance)
    return "\n".join([*lines, f"covariance = [\n{rows},\n]"]) + "\n"


def _numbers(values: Sequence[float]) -> str:
    return f"[{', '.join(repr(float(f'{value:.{_DIGITS}g}')) for value in values)}]"


class PersonInstruments(Table):
    """Information from the trials of one person on plates and synchronisation.

    Attributes:
        name: name of the person.
        files: SHA-256 of every file that this was computed from.
        plates: names of the plates.
        information: (k, k) on the unknowns of each plate, of all plates together and of the synchronisation, SI.
        rhs: (k,) right-hand side of the information.

    Examples:
        >>> from kinertia.io.subject.learnt_files import PersonInstruments
        >>> zeros = (0.0,) * 9
        >>> PersonInstruments(name="A", files=("9f",), plates=("plate 1",), information=(zeros,) * 9, rhs=zeros).name
        'A'
    """

    name: str
    files: tuple[str, ...] = Field(strict=False)
    plates: tuple[str, ...] = Field(strict=False)
    information: tuple[Annotated[tuple[float, ...], Field(strict=False)], ...] = Field(strict=False)
    rhs: tuple[float, ...] = Field(strict=False, validation_alias=AliasChoices("rhs", "right"))

    @model_validator(mode="after")
    def _square(self) -> PersonInstruments:
        count = len(self.plates)
        size, earlier = 5 * count + 4, 4 * count + 4
        rows = {len(self.information), len(self.rhs), *map(len, self.information)}
        if rows == {earlier}:
            problem = "an earlier version of Kinertia wrote it, without a rotation of each plate"
            raise _OutdatedError(earlier, size, problem)
        if rows != {size}:
            plates = "1 plate" if count == 1 else f"{count} plates"
            raise ValueError(f"{self.name}: information and rhs must have {size} rows and columns for {plates}")
        return self


class _OutdatedError(ValueError):
    """A file has the unknowns of an earlier version: so many rows, where others are expected."""

    def __init__(self, rows: int, expected: int, problem: str) -> None:
        super().__init__(problem)
        self.evidence = {"rows": Quantity(float(rows), "1"), "expected": Quantity(float(expected), "1")}


class SessionFile(Table):
    """Content of a whole session file; the part written for human readers is not read again."""

    kinertia: str
    found: dict[str, dict[str, float]]
    people: tuple[PersonInstruments, ...] = Field(alias="person", strict=False, min_length=1)


def read_session(path: Path) -> tuple[PersonInstruments, ...]:
    """Read the information from each person's trials.

    Raises:
        FileError: no such file, or not one that `kinertia instruments` wrote; with the line.
    """
    document = read_toml(path, "a file of kinertia instruments (instruments.toml)")
    try:
        return SessionFile.model_validate(document.content).people
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "its numbers"
        line = document.line(first["loc"]) or document.last_line
        wrong = first.get("ctx", {}).get("error")
        problem = Quantity(str(wrong) if wrong else f"{place}: {first['msg']}")
        known = wrong.evidence if isinstance(wrong, _OutdatedError) else {}
        raise FileError.found(path, "F184", line, entry=Quantity(place), problem=problem, **known) from None


def expect_session(path: Path) -> None:
    """Check that a file is one of `kinertia instruments`, of this version or an earlier one.

    Raises:
        FileError: it is another file.
    """
    content = read_toml(path, "a file of kinertia instruments").content
    if not {"kinertia", "found", "person"} <= set(content):
        raise FileError(path, "not a file of kinertia instruments")


def session_text(
    name: str,
    version: str,
    values: Mapping[str, Mapping[str, tuple[float, float, str]]],
    people: Sequence[PersonInstruments],
) -> str:
    """Return the text of the file.

    Args:
        name: name of the file.
        version: version of Kinertia.
        values: error, SD and unit (m, 1, N m/N, rad or s) by instrument and quantity.
        people: information from each person.
    """
    lines = [
        "# Plate and synchronisation errors of a session, from kinertia instruments. For the subject files:",
        "#     [instruments]",
        f"#     session = {json.dumps(name, ensure_ascii=False)}",
        "# A fit leaves out what its own trials contributed here. Values are errors, recorded minus true.",
        f"kinertia = {json.dumps(version)}",
    ]
    for instrument, quantities in values.items():
        lines += ["", f"[found.{json.dumps(instrument, ensure_ascii=False)}]"]
        for quantity, (value, sd, unit) in quantities.items():
            name, factor = _UNITS[unit]
            key = quantity.replace(" ", "_")
            lines += [f"{key}_{name} = {value * factor:.3f}", f"{key}_sd_{name} = {sd * factor:.3f}"]
    for person in people:
        lines += ["", "[[person]]", f"name = {json.dumps(person.name, ensure_ascii=False)}"]
        lines += [f"files = {json.dumps(person.files)}", f"plates = {json.dumps(person.plates, ensure_ascii=False)}"]
        rows = ",\n".join(f"    {_exact_numbers(row)}" for row in person.information)
        lines += [f"information = [\n{rows},\n]", f"rhs = {_exact_numbers(person.rhs)}"]
    return "\n".join(lines) + "\n"


def _exact_numbers(values: Sequence[float]) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"
