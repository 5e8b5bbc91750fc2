"""Reads the SLURM settings for workers: a TOML file that a laboratory adapts to its cluster once."""

from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from kinertia.errors import FileError
from kinertia.io.text.toml_lines import read_toml
from kinertia.settings import Table

Lines = Annotated[tuple[str, ...], Field(strict=False)]


class SlurmFile(Table):
    """Content of a whole SLURM file; every entry may be left out.

    Examples:
        >>> from kinertia.io.slurm_file import SlurmFile
        >>> SlurmFile(partition="short").workers
        10
    """

    workers: int = Field(default=10, ge=1, le=10_000, description="jobs to ask for; each fits one person at a time")
    memory_gb: float = Field(default=4.0, ge=1.0, description="of each job")
    time: str = Field(default="04:00:00", description="time limit of a job, hours:minutes:seconds")
    partition: str | None = Field(default=None, description="left out: the cluster's default")
    account: str | None = Field(default=None, description="who pays")
    directives: Lines = Field(default=(), description='further lines for sbatch, like ["--qos=low"]')
    before: Lines = Field(default=(), description='commands before the worker starts, like ["module load python"]')
    python: str | None = Field(default=None, description="on the nodes; left out: the one that runs this command")
    interface: str | None = Field(default=None, description="network that nodes and this computer share, like ib0")
    logs: str | None = Field(default=None, description="folder for SLURM's logs; left out: none are kept")


def read_slurm(path: Path) -> SlurmFile:
    """Read and check the file.

    Raises:
        FileError: no such file, an unknown key, or an impossible value; with the line.
    """
    document = read_toml(path, "a file that says how to ask SLURM for workers")
    try:
        return SlurmFile.model_validate(document.content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        known = ", ".join(SlurmFile.model_fields)
        problem = f"{place}: {first['msg']}"
        if first["type"] == "extra_forbidden":
            problem = f"unknown entry '{place}'; known are {known}"
        raise FileError(path, problem, document.line(first["loc"]) or document.last_line) from None
