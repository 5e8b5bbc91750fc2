"""`kinertia check`: what is in the files, and whether a fit can use them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from kinertia.checks.marker_set_match import common_marker_set, markers_of_model
from kinertia.checks.model import ModelCheck, check_model
from kinertia.checks.recording import RecordingCheck, check_recording
from kinertia.checks.verdict import stands_against
from kinertia.cli.options import AsJson, Force, Quiet, Sex, Verbose, number, results_folder
from kinertia.cli.terminal import out, plain_table, show_error, show_verdicts, shown_progress
from kinertia.errors import FileError, KinertiaError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.osim.reader import read_osim
from kinertia.io.recording import read_recording
from kinertia.io.subject_draft import STATIC_NAME, matched_by_name
from kinertia.io.subject_file import SubjectFile, read_subject
from kinertia.model.anthropometry import check_subject
from kinertia.model.marker_set import MarkerSet
from kinertia.report.check_page import save_check_page
from kinertia.trial.data import Recording
from kinertia.trial.marker_quality import travel
from kinertia.trial.telling_movements import missing_movements

_MARKER_FILES, _FORCE_FILES = (".trc", ".c3d"), (".mot", ".sto")
_LISTED = 8


@dataclass(frozen=True)
class _Files:
    """The files of one recording, and the window that the user vouches for."""

    markers: Path
    forces: Path | None = None
    loads: Path | None = None
    window_s: tuple[float, float] | None = None

    @property
    def title(self) -> str:
        return ", ".join(path.name for path in (self.markers, self.forces, self.loads) if path is not None)


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Markers (.trc, .c3d), each with its forces (.mot, .sto; matched by name); or a subject file (.toml); "
            "or models (.osim).",
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
    as_json: AsJson = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show what is in measured files or in a model, and whether it can be used.

    Measured: rates, units, axes; markers and gaps; force plates and which foot
    is on them; the stretch in which all ground contact is measured; the
    vertical force against body mass; the mean vertical
    moment over whole strides, which should be near zero; swapped labels,
    mirrored axes, spikes; forces with a wrong axis, sign, unit or zero.
    With the static trial: whether it is of the same person.

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
    subjects = [path for path in files if path.suffix.lower() == ".toml"]
    if subjects and (len(files) > 1 or any(given is not None for given in (loads, mass, height, sex, markers))):
        raise FileError(subjects[0], "a subject file says it all; give it alone, without other files and options")
    models, mistakes = _check_models([path for path in files if path.suffix.lower() == ".osim"], mass, height, sex)
    measured = [path for path in files if path.suffix.lower() != ".osim"]
    recordings, more = _check_recordings(measured, loads, None if markers is None else read_marker_set(markers), mass)
    mistakes += more
    page = None if output is None else save_check_page(recordings, models, mistakes, output)
    if as_json:
        typer.echo(json.dumps(_told(recordings, models, mistakes), indent=2))
    else:
        with suppress(SystemExit):  # rich's, where nobody reads on (| head)
            _show(recordings, models, page, verbose)
    for mistake in mistakes:
        show_error(mistake)
    if mistakes:
        raise typer.Exit(2)
    judged = [one.verdicts for _, one in recordings] + [one.verdicts for _, one in models]
    raise typer.Exit(int(any(map(stands_against, judged))))


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
    found, mistakes = [], []
    for path in paths:
        try:
            model = read_osim(path)
        except KinertiaError as error:
            mistakes.append(str(error))
            continue
        found.append((path.name, check_model(model.skeleton, model.bsp, mass_kg, height_m, sex)))
    return found, mistakes


def _check_recordings(
    paths: Sequence[Path], loads: Path | None, marker_set: MarkerSet | None, mass_kg: float | None
) -> tuple[list[tuple[str, RecordingCheck]], list[str]]:
    """Findings by title, and a sentence for each recording that cannot be read."""
    wanted, marker_set, mass_kg = _wanted(paths, loads, marker_set, mass_kg)
    recordings, mistakes = _read(wanted)
    if marker_set is None:
        marker_set = common_marker_set([recording for _, recording in recordings])
    told = {recording.mass_kg for _, recording in recordings if recording.mass_kg is not None}
    shared = told.pop() if mass_kg is None and len(told) == 1 else mass_kg  # files of one person
    found = []
    standing = [recording for _, recording in recordings if travel(recording.markers).kind == "stands still"]
    for one, recording in recordings:
        mass = shared if mass_kg is not None or recording.mass_kg is None else recording.mass_kg
        found.append(
            (one.title, check_recording(recording, marker_set, mass, one.window_s, _static_of(recording, standing)))
        )
    return found, mistakes


def _static_of(recording: Recording, standing: Sequence[Recording]) -> Recording | None:
    """The static trial of a recording, where it is clear which that is."""
    return standing[0] if len(standing) == 1 and recording is not standing[0] else None


def _wanted(
    files: Sequence[Path], loads: Path | None, marker_set: MarkerSet | None, mass_kg: float | None
) -> tuple[list[_Files], MarkerSet | None, float | None]:
    """Which files make one recording, the marker set and the body mass if given.

    Raises:
        FileError: a file of another kind, forces without markers, or loads that explain no trial or several.
    """
    if [path.suffix.lower() for path in files] == [".toml"]:
        return _of_subject(read_subject(files[0]))
    for path in files:
        if path.is_dir():
            raise FileError(path, "is a folder; give the files in it, or its subject file (kinertia init drafts one)")
        if path.suffix.lower() not in (*_MARKER_FILES, *_FORCE_FILES):
            known = ", ".join((*_MARKER_FILES, *_FORCE_FILES, ".toml", ".osim"))
            hint = "; give ExternalLoads with --loads" if path.suffix.lower() == ".xml" else ""
            raise FileError(path, f"a '{path.suffix}' file cannot be checked; expected {known}{hint}")
    marked = [path for path in files if path.suffix.lower() in _MARKER_FILES]
    forces = [path for path in files if path not in marked]
    pairs = _matched(marked, forces)
    alone = [path for path in forces if path not in pairs.values()]
    if alone:
        goes = "goes with none of the marker files by its name" if marked else "holds forces only"
        raise FileError(alone[0], f"{goes}; check it together with its markers (.trc, .c3d)")
    wanted = [_Files(path, pairs.get(path)) for path in marked]
    if loads is not None:
        having = [k for k, one in enumerate(wanted) if one.forces is not None] or list(range(len(wanted)))
        if len(having) != 1:
            raise FileError(
                loads, f"explains one trial's forces, but {len(having)} are given; check one trial at a time"
            )
        wanted[having[0]] = replace(wanted[having[0]], loads=loads)
    return wanted, marker_set, mass_kg


def _matched(marked: Sequence[Path], forces: Sequence[Path]) -> dict[Path, Path]:
    """Marker files with their forces; those of static trials among themselves, unless there are just two files."""
    if len(marked) == len(forces) == 1:
        return matched_by_name(marked, forces)
    pairs: dict[Path, Path] = {}
    for static in (True, False):
        groups = [[p for p in paths if bool(STATIC_NAME.search(p.stem)) == static] for paths in (marked, forces)]
        pairs |= matched_by_name(*groups)
    return pairs


def _of_subject(subject: SubjectFile) -> tuple[list[_Files], MarkerSet | None, float | None]:
    named = subject.model.markers
    trials = [_Files(trial.markers, trial.forces, trial.loads, trial.window_s) for trial in subject.trials]
    marker_set = None if named is None else read_marker_set(named)
    if subject.model.osim is not None:
        marker_set = markers_of_model(read_osim(subject.model.osim))
    static = [] if subject.model.static is None else [_Files(subject.model.static)]
    return [*static, *trials], marker_set, subject.subject.mass_kg


def _read(wanted: Sequence[_Files]) -> tuple[list[tuple[_Files, Recording]], list[str]]:
    """The recordings, and a sentence for each that cannot be read."""
    recordings, mistakes = [], []
    with shown_progress() as progress:
        for k, one in enumerate(wanted):
            progress("reading", k / len(wanted))
            try:
                recordings.append((one, read_recording(one.markers, one.forces, one.loads)))
            except KinertiaError as error:
                mistakes.append(str(error))
    return recordings, mistakes


def _show_facts(title: str, facts: Sequence[tuple[str, str]]) -> None:
    out.print(f"\n{title}")
    table = Table.grid(padding=(0, 2), expand=False)
    for name, told in facts:
        table.add_row(name, told)
    out.print(table)


def _show_model(title: str, found: ModelCheck) -> None:
    _show_facts(title, found.facts())
    table = plain_table(*found.columns)
    for row in found.rows():
        table.add_row(*row)
    out.print(table)
    show_verdicts(found.verdicts)
    for sentence in found.left_out:
        out.print(f"left out: {sentence}")


def _show_recording(title: str, found: RecordingCheck, verbose: bool) -> None:
    _show_facts(title, found.facts())
    shown = [one for one in found.markers if verbose or one.share < 1.0]
    if shown:
        gaps = plain_table("marker", "seen\n(%)", "longest gap\n(s)")
        for one in shown if verbose else shown[:_LISTED]:
            gaps.add_row(one.label, f"{100 * one.share:.0f}", f"{one.longest_gap_s:.2f}")
        out.print(gaps)
        if not verbose and len(shown) > _LISTED:
            out.print(f"and {len(shown) - _LISTED} more markers with gaps (--verbose lists them)")
    if found.plates:
        plates = plain_table("plate", "foot on plate", "peak\n(N)", "off plate\n(% of load)")
        plates.padding = (0, 1)
        for plate in found.plates:
            off = "-" if plate.outside_share is None else f"{100 * plate.outside_share:.0f}"
            plates.add_row(plate.name, plate.stood_on(), f"{plate.peak_n:.0f}", off)
        out.print(plates)
    show_verdicts(found.verdicts)
    for note in found.notes:
        out.print(f"assumed: {note}")
