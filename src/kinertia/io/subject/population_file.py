"""Writes and reads what `kinertia population` learnt about a group, as one TOML text.

The top lists, for readers, what was learnt about each parameter. Below are mean and covariance in relative parameters,
and the files that they are from, so that no recordings count twice.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.text.toml_lines import read_toml
from kinertia.model.bsp import PARAMETERS
from kinertia.settings import Table

Numbers = Annotated[tuple[float, ...], Field(strict=False)]
_DIGITS = 13


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
        >>> from kinertia.io.subject.population_file import PopulationFile
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
        f"# {name:20s} {mean:+6.2f} +- {sd:4.2f}   {each:4.2f}"
        for name, mean, sd, each in zip(names, population.mean, population.mean_sd, spread.tolist(), strict=True)
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
