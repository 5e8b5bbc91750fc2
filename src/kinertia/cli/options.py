"""Defines the options that several commands share, and what they do at once."""

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.terminal import be_quiet
from kinertia.diagnostics.runner import unknown_codes
from kinertia.errors import FileError
from kinertia.findings.rule import matching
from kinertia.io.results.output_folder import check_folder, expect_own_folder
from kinertia.settings import Overrule, number_of, sex_of


def results_folder(
    folder: Path, overwrite: bool, sub_folders: Collection[str] = (), files: Collection[str] = ()
) -> None:
    """Raise an error, before any work, if results cannot or may not go to a folder, or its `sub_folders`.

    Not all names of results are known so early; `files` lists those that are.

    Raises:
        FileError: it cannot be written to, or holds other files and `overwrite` is False.
    """
    if not overwrite:
        expect_own_folder(folder, ", or --overwrite to write among them")
    check_folder(folder, sub_folders, files)


def number(text: str) -> float:
    """Parse a number with a decimal point or a decimal comma.

    Raises:
        BadParameter: the text is not a number.
    """
    try:
        return number_of(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def sex(text: str) -> str:
    """Parse "male" or "female"; m and f are enough.

    Raises:
        BadParameter: the text is neither.
    """
    known = sex_of(text)
    if known not in ("male", "female"):
        raise typer.BadParameter(f"'{text}' is neither male (m) nor female (f): the literature has a table for each")
    return str(known)


Sex = Annotated[
    str | None, typer.Option(parser=sex, metavar="SEX", help="male or female (m, f): selects the body tables.")
]
Mass = Annotated[
    float | None, typer.Option(parser=number, metavar="KG", help="Body mass, kg; a C3D file may contain it.")
]
Height = Annotated[
    float | None, typer.Option(parser=number, metavar="M", help="Stature, m; a C3D file may contain it.")
]
Static = Annotated[Path | None, typer.Option(help="Static trial (.c3d, .trc, .tsv, .csv).")]
Forces = Annotated[Path | None, typer.Option(help="Ground reactions (.mot, .sto, .forces); a C3D file has its own.")]
MarkerSetName = Annotated[
    str | None,
    typer.Option("--markers", help="Marker set: a preset or a TOML file; found from the labels if left out."),
]
ScaledModel = Annotated[
    Path | None,
    typer.Option("--model", help="Scaled OpenSim model (.osim), in place of --static, --sex and --height."),
]
Calibrate = Annotated[
    bool, typer.Option("--calibrate", help="Let markers and joint centres of the OpenSim model move.")
]
Waive = Annotated[
    list[str] | None,
    typer.Option("--waive", metavar="CODE", help="Go on in spite of this ERROR; shown as waived. May be repeated."),
]
Output = Annotated[Path, typer.Option("--output", "-o", help="Folder for the results; earlier ones are replaced.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write even if the folder holds other files.")]
Loads = Annotated[
    Path | None,
    typer.Option("--loads", "--external-loads", help="OpenSim ExternalLoads (.xml) that explains the forces file."),
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", callback=be_quiet, help="Show errors only; the exit status gives the outcome.")
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Show every assumption and detail as well.")]


def overrule_of(waive: Sequence[str] | None) -> Overrule:
    """Parse the codes that `--waive` overrules.

    Raises:
        BadParameter: no such code, or one that cannot be waived.
    """
    overrule = Overrule(waive=tuple(code.upper() for code in waive or ()))
    for code in unknown_codes(overrule):
        hard = "cannot be waived: nothing can be computed with it" if matching(code) else "is not the code of a finding"
        raise typer.BadParameter(f"{code} {hard}; see kinertia explain {code[:1]}")
    return overrule


def own_file(output: Path, read: Callable[[Path], object], command: str) -> None:
    """Check that a command may write a file: a new one, or one of its own, which `read` can read.

    Raises:
        FileError: it is a folder, in no folder, or a file of another kind.
    """
    if output.is_dir():
        raise FileError(output, "a folder; give the name of a file")
    if not output.absolute().parent.is_dir():
        raise FileError(output, f"no such folder: {output.absolute().parent}")
    if output.exists():
        try:
            read(output)
        except FileError:
            raise FileError(output, f"not a file that {command} wrote; give another name with -o") from None
