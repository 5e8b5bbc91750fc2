"""`kinertia fit`: from a subject file, or from options, to a folder of results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.checks.verdict import stands_against, verdicts
from kinertia.cli.fit_report import report_fit, report_verdicts
from kinertia.cli.options import Force, Output, Quiet, Verbose, results_folder
from kinertia.cli.terminal import out, shown_progress
from kinertia.errors import FileError
from kinertia.estimation.from_files import fit_subject
from kinertia.estimation.result import Fit
from kinertia.io.provenance import command_line, provenance_of
from kinertia.io.subject_file import SubjectFile, read_subject, subject_file_in, subject_from_options, with_settings
from kinertia.report.files import save_fit


def fit(
    trial: Annotated[
        Path,
        typer.Argument(
            help="A subject file (.toml), a folder with one, or markers of one trial (.c3d, .trc, .tsv, .csv)."
        ),
    ],
    output: Output = Path("out"),
    static: Annotated[Path | None, typer.Option(help="Static trial (.c3d, .trc, .tsv, .csv).")] = None,
    forces: Annotated[Path | None, typer.Option(help="Ground reactions (.mot, .sto); a C3D file has its own.")] = None,
    loads: Annotated[
        Path | None, typer.Option(help="OpenSim ExternalLoads (.xml) that explains the forces file.")
    ] = None,
    mass: Annotated[float | None, typer.Option(help="Body mass, kg; a C3D file may contain it.")] = None,
    height: Annotated[float | None, typer.Option(help="Stature, m; a C3D file may contain it.")] = None,
    sex: Annotated[str | None, typer.Option(help="male or female: which table of the literature.")] = None,
    markers: Annotated[
        str | None,
        typer.Option(help="Marker set: a preset or a TOML file; found from the labels if left out."),
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="Scaled OpenSim model (.osim), in place of --static, --sex and --height.")
    ] = None,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Let markers and joint centres of the OpenSim model move.")
    ] = False,
    method: Annotated[str | None, typer.Option(help="Estimator: simultaneous (default) or two-level.")] = None,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Estimate body segment parameters from gait.

    Exit status 1 if there is an estimate but a check of it failed
    (see kinertia --help).

    [bold]Examples[/]

    kinertia fit subject.toml -o out

    kinertia fit FOLDER -o out

    kinertia fit walk.c3d --static static.c3d --mass 41.5 --height 1.61 --sex male -o out

    kinertia fit walk.trc --forces walk_grf.mot --static static.trc --mass 72.6 --height 1.803 --sex male -o out

    kinertia fit walk.trc --forces walk_grf.mot --loads loads.xml --model scaled.osim --mass 72.6 -o out
    """
    options = {
        "--static": static,
        "--forces": forces,
        "--loads": loads,
        "--mass": mass,
        "--height": height,
        "--sex": sex,
        "--markers": markers,
        "--model": model,
        "--calibrate": calibrate or None,
    }
    wanted = _wanted(trial, options, method)
    names = [one.name for one in wanted.trials]
    results_folder(output, force, names if len(names) > 1 else ())
    result = _run(wanted)
    folder = save_fit(result, output, provenance_of(wanted, _command(trial, options, method, output)))
    judged = verdicts(result)
    if not out.quiet:
        report_fit(result)
        report_verdicts(judged, result, verbose)
        out.print(f"results in {folder}", soft_wrap=True)
    raise typer.Exit(int(stands_against(judged)))


def _command(trial: Path, options: dict[str, Any], method: str | None, output: Path) -> str:
    """The command line that repeats this run."""
    given = {**options, "--method": method, "-o": output}
    words = [
        str(word)
        for name, value in given.items()
        if value is not None
        for word in ([name] if value is True else [name, value])
    ]
    return command_line(["kinertia", "fit", str(trial), *words])


def _wanted(trial: Path, options: dict[str, Any], method: str | None) -> SubjectFile:
    """What to estimate, by the subject file or by options."""
    if trial.is_dir():
        trial = subject_file_in(trial)
    if trial.suffix.lower() == ".toml":
        given = [name for name, value in options.items() if value is not None]
        if given:
            raise FileError(trial, f"a subject file says it all; put {', '.join(given)} into it instead")
        wanted = read_subject(trial)
    else:
        wanted = _from_options(trial, options)
    return wanted if method is None else with_settings(wanted, method=method)


def _from_options(trial: Path, options: dict[str, Any]) -> SubjectFile:
    """The subject file that these options stand for."""
    given = {
        key: str(value) if isinstance(value, Path) else value for key, value in options.items() if value is not None
    }
    for name in ("--static", "--sex"):
        if name not in given and "--model" not in given:
            hint = " (or --model)" if name == "--static" else ""
            raise FileError(
                trial, f"a trial on its own needs {name}{hint}; or write a subject file (kinertia init FOLDER)"
            )
    names = {
        "subject": {"--mass": "mass_kg", "--height": "height_m", "--sex": "sex"},
        "model": {"--static": "static", "--markers": "markers", "--model": "osim", "--calibrate": "calibrate"},
        "trial": {"--forces": "forces", "--loads": "loads"},
    }
    tables = {
        table: {key: given[option] for option, key in entries.items() if option in given}
        for table, entries in names.items()
    }
    trials = [{"markers": str(trial), **tables["trial"]}]
    return subject_from_options(
        {"subject": {"name": trial.stem, **tables["subject"]}, "model": tables["model"], "trial": trials}
    )


def _run(wanted: SubjectFile) -> Fit:
    with shown_progress() as progress:
        return fit_subject(wanted, progress)
