"""Defines `kinertia fit`: from a subject file, or from options, to a folder of results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import typer

from kinertia.cli.common import (
    Calibrate,
    Forces,
    Height,
    Loads,
    MarkerSetName,
    Mass,
    Outcome,
    Output,
    Overwrite,
    Quiet,
    ScaledModel,
    Sex,
    Static,
    Verbose,
    Waive,
    of_error,
    out,
    overrule_of,
    results_folder,
    show_problem,
    shown_progress,
)
from kinertia.cli.findings import (
    failure_explained,
    report_tables,
    show_coverage,
    show_idle_waivers,
    show_overview,
)
from kinertia.errors import FileError, KinertiaError, expect_path
from kinertia.io.file_names import command_line, same_folder
from kinertia.io.recording import expect_recording
from kinertia.io.subject.provenance import provenance_of
from kinertia.io.subject.reader import read_subject, subject_file_in, subject_from_options, with_settings
from kinertia.io.subject.tables import SubjectFile
from kinertia.report.exports.contents import FitContent, content_of
from kinertia.report.exports.files import FIT_FILES, TRIAL_FILES, save_fit
from kinertia.settings import MethodName, Overrule
from kinertia.workflow.from_files import fit_subject


def _methods(typed: str) -> list[str]:
    """Return completions that the shell offers for --method."""
    return [name for name in get_args(MethodName) if name.startswith(typed)]


def fit(
    trials: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Subject files (.toml) or folders with one; or markers of one trial (.c3d, .trc, .tsv, .csv).",
        ),
    ],
    output: Output = Path("out"),
    static: Static = None,
    forces: Forces = None,
    loads: Loads = None,
    mass: Mass = None,
    height: Height = None,
    sex: Sex = None,
    markers: MarkerSetName = None,
    model: ScaledModel = None,
    calibrate: Calibrate = False,
    method: Annotated[
        str | None, typer.Option(help="Estimator: simultaneous (default) or two-level.", autocompletion=_methods)
    ] = None,
    waive: Waive = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    shown_table: Annotated[
        bool, typer.Option("--table", help="Show residuals and the table of segments as well.")
    ] = False,
) -> Outcome:
    """Estimate body segment parameters from gait.

    With several subject files, each gets a folder of its name in the folder for
    the results; an error in one does not stop the others from being fitted.

    Exit status 1 if there is an estimate but an ERROR of it is open, or a
    trial was left out (see kinertia --help).

    [bold]Examples[/]

    kinertia fit subject.toml -o out

    kinertia fit FOLDER -o out

    kinertia fit anna.toml ben.toml -o out

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
    runs = _runs(trials, output, options, method, overrule_of(waive))
    for run in runs:
        names = [trial.name for trial in run.wanted.trials]
        several = len(names) > 1
        files = FIT_FILES if several else (*FIT_FILES, *TRIAL_FILES)
        results_folder(run.folder, overwrite, names if several else (), files)
    summaries, status = [], 0
    for run in runs:
        try:
            with failure_explained(run.overrule.waive, run.given, run.wanted.model, run.command):
                with shown_progress() as progress:
                    result = fit_subject(run.wanted, progress, run.overrule)
                content = content_of(result, provenance_of(run.wanted, run.command))
                save_fit(content, run.folder, force=True)
        except KinertiaError as error:
            if len(runs) == 1:
                raise
            show_problem(error, f"{run.given}: ")
            summaries.append({"folder": None, "file": str(run.given), **of_error(error)})
            status = 2
            continue
        status = max(status, int(result.overview.failed))
        summaries.append({"folder": str(run.folder), **content.summary, "bsp": _rows(content.tables["bsp.csv"])})
        if not quiet:
            _show(content, run, verbose, shown_table)
    return Outcome(summaries if len(runs) > 1 else summaries[0], status)


def _rows(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows of a table."""
    plain = {name: np.asarray(values).tolist() for name, values in columns.items()}
    return [dict(zip(plain, row, strict=True)) for row in zip(*plain.values(), strict=True)]


@dataclass(frozen=True)
class _Run:
    """One person's run: what was given, the folder for results, words of the command that repeats it, subject file."""

    given: Path
    folder: Path
    words: Sequence[str]
    wanted: SubjectFile
    overrule: Overrule

    @property
    def command(self) -> str:
        """The command that repeats it."""
        return command_line(self.words)


def _runs(
    trials: Sequence[Path], output: Path, options: dict[str, Any], method: str | None, overrule: Overrule
) -> list[_Run]:
    """Plan the runs, each with a folder of its own if there are several; all subject files are read here."""
    folders = [output]
    if len(trials) > 1:
        for path in trials:
            if path.suffix.lower() != ".toml" and not path.is_dir():
                raise FileError(
                    path, "is not a subject file; several people can only be fitted from their subject files"
                )
        names = [_name(path) for path in trials]
        for k, name in enumerate(names):
            if before := [path for path, other in zip(trials, names[:k], strict=False) if same_folder(name, other)]:
                raise FileError(trials[k], f"its results would go to {name}, as those of {before[0]}; rename one file")
        folders = [output / name for name in names]
    return [
        _Run(
            path,
            folder,
            _command(path, {**options, "--waive": overrule.waive or None}, method, folder),
            _wanted(path, options, method),
            overrule,
        )
        for path, folder in zip(trials, folders, strict=True)
    ]


def _show(content: FitContent, run: _Run, verbose: bool, tables: bool) -> None:
    """Show verdict and findings of a fit and the folder of its results, with tables where they are wanted."""
    fit = content.fit
    if verbose or tables:
        report_tables(fit, content.summary)
    show_overview(fit.overview, verbose)
    show_idle_waivers(run.overrule.waive, fit.overview.findings)
    show_coverage(fit)
    out.print(f"results in {run.folder}", soft_wrap=True)


def _name(path: Path) -> str:
    """Name the results of a subject file: by its name, or by its folder if it is just subject.toml."""
    return path.resolve().name if path.is_dir() else path.resolve().parent.name if path.stem == "subject" else path.stem


def _command(trial: Path, options: dict[str, Any], method: str | None, output: Path) -> list[str]:
    """Return the words of the command line that repeats this run."""
    given = {**options, "--method": method, "-o": output}
    words = [str(word) for name, value in given.items() if value is not None for word in _words(name, value)]
    return ["kinertia", "fit", str(trial), *words]


def _words(name: str, value: Any) -> list[Any]:
    """Return an option as it is typed."""
    if isinstance(value, tuple):
        return [word for value_word in value for word in (name, value_word)]
    return [name] if value is True else [name, value]


def _wanted(trial: Path, options: dict[str, Any], method: str | None) -> SubjectFile:
    """Return what to estimate, from the subject file or from options."""
    if trial.suffix.lower() != ".toml" and not trial.is_dir():
        content = _content(trial, options)
        wanted = subject_from_options(content)
    else:
        path = subject_file_in(trial) if trial.is_dir() else trial
        if given := [name for name, value in options.items() if value is not None]:
            raise FileError(path, f"a subject file contains everything; put {', '.join(given)} into it instead")
        wanted = read_subject(path)
    return wanted if method is None else with_settings(wanted, method=method)


def _content(trial: Path, options: dict[str, Any]) -> dict[str, Any]:
    """Return the content of the subject file that these options represent."""
    given = {
        key: str(value) if isinstance(value, Path) else value for key, value in options.items() if value is not None
    }
    expect_recording(trial)
    for path in (trial, *(options[name] for name in ("--static", "--forces", "--loads", "--model"))):
        if path is not None:
            expect_path(path)
    if "--sex" not in given and "--model" not in given:
        raise FileError(
            trial, "a trial on its own needs --sex (or --model); or write a subject file (kinertia init FOLDER)"
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
    return {"subject": {"name": trial.stem, **tables["subject"]}, "model": tables["model"], "trial": trials}
