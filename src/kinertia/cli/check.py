"""`kinertia check`: what is in the files, and whether a fit can use them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from kinertia.cli.options import Force, Quiet, Sex, Verbose, number, results_folder
from kinertia.cli.outcome import Outcome
from kinertia.cli.terminal import out, plain_table, show_error, show_verdicts, shown_progress
from kinertia.diagnostics.model.model_check import ModelCheck, check_model
from kinertia.diagnostics.result.verdict import stands_against
from kinertia.diagnostics.subject.telling_movements import missing_movements
from kinertia.errors import FileError, KinertiaError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.osim.reader import read_osim
from kinertia.io.subject_file import read_subject, subject_file_in
from kinertia.model.anthropometry import check_subject
from kinertia.report.check_page import save_check_page
from kinertia.workflow.files import PersonFiles, check_files, files_by_name, files_of_subject
from kinertia.workflow.recording import RecordingCheck

_LISTED = 8


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Markers (.trc, .c3d, .tsv, .csv), each with its forces (.mot, .sto, .tsv; matched by name); or a "
            "subject file (.toml); or models (.osim).",
        ),
    ],
    loads: Annotated[
        Path | None, typer.Option(help="OpenSim ExternalLoads (.xml) that explains the forces file.")
    ] = None,
    mass: Annotated[
        float | None,
        typer.Option(parser=number, metavar="KG", help="Body mass, kg, to compare forces and models with."),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(parser=number, metavar="M", help="Stature, m, to compare models with the literature."),
    ] = None,
    sex: Sex = None,
    markers: Annotated[
        str | None, typer.Option(help="Marker set: a preset or a TOML file; found from the labels if left out.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the same results as a page, check.html.")
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> Outcome:
    """Show what is in measured files or in a model, and whether it can be used.

    Measured: rates, units, axes; markers and gaps; force plates and which foot
    is on them; the stretch in which all ground contact is measured; the
    vertical force against body mass; the mean vertical
    moment over whole strides, which should be near zero; swapped labels,
    mirrored axes, spikes, jumps, lost or invented frames; forces with a wrong
    axis, sign, unit, zero, gain, place or clock.
    With the static trial: whether it is of the same person and session, and
    goes with the stature.

    Model: total mass; each segment against the literature for this person;
    impossible, rounded or placeholder inertias; left against right.
    Exit status 1 if a check failed: no fit or no simulation can rest on it.

    [bold]Examples[/]

    kinertia check walk.c3d static.c3d

    kinertia check walk.trc walk_grf.mot --loads loads.xml --mass 72.6 -o out

    kinertia check subject.toml

    kinertia check scaled.osim --mass 72.6 --height 1.80 --sex male
    """
    if output is not None:
        results_folder(output, force)
    check_subject(70.0 if mass is None else mass, 1.7 if height is None else height, sex or "male")
    files = [subject_file_in(path) if _holds_subject_file(path) else path for path in files]
    subjects = [path for path in files if path.suffix.lower() == ".toml"]
    if subjects and (len(files) > 1 or any(given is not None for given in (loads, mass, height, sex, markers))):
        raise FileError(subjects[0], "a subject file says it all; give it alone, without other files and options")
    models, mistakes = _check_models([path for path in files if path.suffix.lower() == ".osim"], mass, height, sex)
    measured = [path for path in files if path.suffix.lower() != ".osim"]
    marker_set = None if markers is None else read_marker_set(markers)
    if subjects:
        wanted = files_of_subject(read_subject(subjects[0]))
        models += wanted.models
    else:
        wanted = PersonFiles(files_by_name(measured, loads), marker_set, mass, height)
    with shown_progress() as progress:
        recordings, more = check_files(wanted, lambda share: progress("reading", share))
    mistakes += more
    page = None if output is None else save_check_page(recordings, models, mistakes, output)
    with suppress(SystemExit):  # rich's, where nobody reads on (| head)
        _show(recordings, models, page, verbose)
    for mistake in mistakes:
        show_error(mistake)
    judged = [one.verdicts for _, one in recordings] + [one.verdicts for _, one in models]
    status = 2 if mistakes else int(any(map(stands_against, judged)))
    return Outcome(_told(recordings, models, mistakes), status)


def _holds_subject_file(path: Path) -> bool:
    return path.is_dir() and any(each.suffix.lower() == ".toml" for each in path.iterdir())


def _told(
    recordings: Sequence[tuple[str, RecordingCheck]], models: Sequence[tuple[str, ModelCheck]], mistakes: Sequence[str]
) -> dict[str, Any]:
    """The same for scripts."""

    def each(found: Sequence[tuple[str, RecordingCheck | ModelCheck]]) -> list[dict[str, Any]]:
        return [
            {"name": name, "verdicts": [verdict._asdict() for verdict in one.verdicts], "facts": dict(one.facts())}
            for name, one in found
        ]

    return {"recordings": each(recordings), "models": each(models), "errors": list(mistakes)}


def _show(
    recordings: Sequence[tuple[str, RecordingCheck]],
    models: Sequence[tuple[str, ModelCheck]],
    page: Path | None,
    verbose: bool,
) -> None:
    """Everything on the terminal."""
    for title, recording in recordings:
        _show_recording(title, recording, verbose)
    lacking = missing_movements(recording.telling for _, recording in recordings if recording.plates)
    if lacking is not None:
        out.print(f"\n{lacking}")
    for title, model in models:
        _show_model(title, model)
    if page is not None:
        out.print(f"page in {page}", soft_wrap=True)


def _check_models(
    paths: Sequence[Path], mass_kg: float | None, height_m: float | None, sex: str | None
) -> tuple[list[tuple[str, ModelCheck]], list[str]]:
    """Findings by title, and a sentence for each model that cannot be read."""
    checks, mistakes = [], []
    for path in paths:
        try:
            model = read_osim(path)
        except KinertiaError as error:
            mistakes.append(str(error))
            continue
        checks.append((path.name, check_model(model.skeleton, model.bsp, mass_kg, height_m, sex)))
    return checks, mistakes


def _show_facts(title: str, facts: Sequence[tuple[str, str]]) -> None:
    out.print(f"\n{title}")
    table = Table.grid(padding=(0, 2), expand=False)
    for name, sentence in facts:
        table.add_row(name, sentence)
    out.print(table)


def _show_model(title: str, model_check: ModelCheck) -> None:
    _show_facts(title, model_check.facts())
    table = plain_table(*model_check.columns)
    for row in model_check.rows():
        table.add_row(*row)
    out.print(table)
    show_verdicts(model_check.verdicts)
    for sentence in model_check.left_out:
        out.print(f"left out: {sentence}")


def _show_recording(title: str, recording_check: RecordingCheck, verbose: bool) -> None:
    _show_facts(title, recording_check.facts())
    shown = [one for one in recording_check.markers if verbose or one.share < 1.0]
    if shown:
        gaps = plain_table("marker", "seen\n(%)", "longest gap\n(s)")
        for one in shown if verbose else shown[:_LISTED]:
            gaps.add_row(one.label, f"{100 * one.share:.0f}", f"{one.longest_gap_s:.2f}")
        out.print(gaps)
        if not verbose and len(shown) > _LISTED:
            out.print(f"and {len(shown) - _LISTED} more markers with gaps (--verbose lists them)")
    if recording_check.plates:
        plates = plain_table("plate", "foot on plate", "peak\n(N)", "off plate\n(% of load)")
        plates.padding = (0, 1)
        for plate in recording_check.plates:
            off = "-" if plate.outside_share is None else f"{100 * plate.outside_share:.0f}"
            plates.add_row(plate.name, plate.stood_on(), f"{plate.peak_n:.0f}", off)
        out.print(plates)
    show_verdicts(recording_check.verdicts)
    for note in recording_check.notes:
        out.print(f"assumed: {note}")
