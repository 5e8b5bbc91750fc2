"""The command line: `kinertia fit` and `init`; `kinertia.cli.check` and `kinertia.cli.study` have the others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.checks.verdict import stands_against, verdicts
from kinertia.cli.check import check
from kinertia.cli.fit_report import report_fit, report_verdicts
from kinertia.cli.options import Force, Output, Quiet, Verbose, results_folder
from kinertia.cli.plan import crossval, plan
from kinertia.cli.study import demo, study
from kinertia.cli.terminal import out, show_error, shown_progress
from kinertia.errors import FileError, KinertiaError
from kinertia.estimation.from_files import fit_subject
from kinertia.estimation.result import Fit
from kinertia.io.output_folder import write_then_rename
from kinertia.io.provenance import VERSION, command_line, provenance_of
from kinertia.io.subject_draft import init_subject
from kinertia.io.subject_file import SubjectFile, read_subject, subject_from_options, with_settings
from kinertia.report.files import save_fit

# typer keeps these line ends: at most 78 columns
_MANUAL = """Body segment parameters from gait.

Markers and ground reaction forces in; masses, centres of mass and inertias of
all segments out, with a motion that they and the forces explain.

[bold]In which order[/]

kinertia demo                 see it work, on a synthetic person
kinertia demo --measured      see it work, on a measured walk
kinertia init FOLDER          draft FOLDER/subject.toml from your files
kinertia check subject.toml   can a fit use them? gaps, plates, axes, mass
kinertia fit subject.toml     estimate; the results go to the folder out
kinertia crossval subject.toml   do they hold on a held-out trial?
kinertia plan                 which motions to record, by their error bars

Every command says more with --help, and has an example there.

[bold]What it needs[/]

A static trial (the person standing; C3D or TRC), one or more gait trials with
force plates (C3D, or TRC with MOT or STO), body mass, stature and sex.
Or, with fit --model, your scaled OpenSim model (.osim), trials and body mass.

[bold]Exit status[/]

  0  done
  1  done, but a check failed. In fit: not converged; physically impossible
     segments; segments that contradict the literature; markers or residuals
     beyond OpenSim's guideline (markers 20 mm RMS; force 10 N RMS, 25 N peak,
     5 % of the largest external force; moment 50 N m RMS, 75 N m peak).
     In check: something that a fit or a simulation cannot rest on.
  2  an error in files or options, reported in one line
130  interrupted; nothing half-written is left

Results go to standard output, progress and errors to standard error.
"""

app = typer.Typer(
    name="kinertia",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help=_MANUAL,
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; a user's error is one line and exit status 2."""
    try:
        app(args=arguments, prog_name="kinertia")
    except KinertiaError as error:
        show_error(str(error))
    except OSError as error:
        show_error(f"{error.filename}: {error.strerror}; check the path, its permissions and the space on the disk")
    raise SystemExit(2)


def _version(wanted: bool) -> None:
    if wanted:
        out.print(VERSION)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def fit(
    trial: Annotated[Path, typer.Argument(help="A subject file (.toml), or the markers of one trial (.c3d, .trc).")],
    output: Output = Path("out"),
    static: Annotated[Path | None, typer.Option(help="Static trial (.c3d, .trc).")] = None,
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
    results_folder(output, force)
    result = _run(wanted)
    folder = save_fit(result, output, provenance_of(wanted, _command(trial, options, method, output)))
    judged = verdicts(result)
    report_fit(result)
    report_verdicts(judged, result, verbose)
    out.print(f"results in {folder}", soft_wrap=True)
    raise typer.Exit(int(stands_against(judged)))


def init(
    folder: Annotated[Path, typer.Argument(help="Folder with the files of one person.")],
) -> None:
    """Write a first subject.toml from the files in a folder.

    [bold]Example[/]

    kinertia init data/subject01
    """
    path = folder / "subject.toml"
    if path.exists():
        raise FileError(path, "exists already and is left alone; remove it to draft a new one")
    text = init_subject(folder)
    write_then_rename(path, text)
    out.print(f"wrote {path}: fill in what it asks for, then run: kinertia fit {path} -o out", soft_wrap=True)


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


for _entry in (demo, init, check, fit, crossval, plan):
    app.command()(_entry)
app.add_typer(study, name="study")
