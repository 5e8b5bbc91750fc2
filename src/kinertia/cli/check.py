"""Defines `kinertia check`: what is in the files, and whether a fit can use them."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from kinertia.cli.common import (
    Calibrate,
    Forces,
    Height,
    Loads,
    MarkerSetName,
    Mass,
    Outcome,
    Overwrite,
    Quiet,
    ScaledModel,
    Sex,
    Static,
    Verbose,
    Waive,
    out,
    overrule_of,
    plain_table,
    results_folder,
    shown_progress,
)
from kinertia.cli.findings import show_idle_waivers, show_overview, waivers_reported
from kinertia.errors import FileError, expect_path
from kinertia.estimation.prepared import Progress
from kinertia.findings.overview import Overview
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.opensim.reader import read_osim
from kinertia.io.subject.reader import expect_one_model, read_subject, subject_file_in
from kinertia.model.anthropometry import check_subject
from kinertia.report.pages.check_page import save_check_page
from kinertia.settings import Subject
from kinertia.workflow.check import (
    ModelOverview,
    PersonCheck,
    RecordingCheck,
    RecordingFiles,
    check_osim,
    check_person,
    files_by_name,
    read_files,
    trial_names,
)
from kinertia.workflow.person import Person, read_person


@dataclass(frozen=True, eq=False)
class _Checked:
    """Everything that was asked for, the files of each recording, and what a subject file lacks for a fit."""

    person: PersonCheck | None
    models: Sequence[ModelOverview]
    files: Mapping[str, str]
    lacking: Sequence[str] = ()

    def facts(self, recording: RecordingCheck) -> list[tuple[str, str]]:
        """Return the files of a recording, and its contents."""
        files = self.files.get(recording.context.name)
        return [*([] if files is None else [("files", files)]), *recording.facts()]

    @property
    def overviews(self) -> list[Overview]:
        of_person = [] if self.person is None else [self.person.overview]
        return [*of_person, *(model.overview for model in self.models)]

    @property
    def status(self) -> int:
        """Exit status: 1 where an ERROR is open."""
        return int(any(overview.failed for overview in self.overviews))


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Markers (.trc, .c3d, .tsv, .csv), each with its forces (.mot, .sto, .tsv, .forces; matched by "
            "name); or a subject file (.toml); or models (.osim).",
        ),
    ],
    static: Static = None,
    forces: Forces = None,
    loads: Loads = None,
    mass: Mass = None,
    height: Height = None,
    sex: Sex = None,
    markers: MarkerSetName = None,
    model: ScaledModel = None,
    calibrate: Calibrate = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the same results as a page, check.html.")
    ] = None,
    waive: Waive = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> Outcome:
    """Show what is in measured files or in a model, and whether it can be used.

    Applies the rules that a fit applies before inverse kinematics: markers,
    labels, force plates, synchronisation, the subject, the OpenSim model.
    Takes what kinertia fit takes. Without --forces and --static, forces and
    static trial are found by names and data.

    Each finding has a code; kinertia explain CODE explains it.
    Exit status 1 if an ERROR is open: such a recording or model cannot be used.

    [bold]Examples[/]

    kinertia check walk.c3d static.c3d

    kinertia check walk.c3d --static static.c3d --mass 41.5 --height 1.61 --sex male

    kinertia check walk.trc --forces walk_grf.mot --loads loads.xml --model scaled.osim --mass 72.6 -o out

    kinertia check subject.toml

    kinertia check scaled.osim --mass 72.6 --height 1.80 --sex male
    """
    if output is not None:
        results_folder(output, overwrite)
    check_subject(70.0 if mass is None else mass, 1.7 if height is None else height, sex or "male")
    for path in files:
        if not path.suffix:  # a folder
            expect_path(path)
    files = [subject_file_in(path) if _holds_subject_file(path) else path for path in files]
    subjects = [path for path in files if path.suffix.lower() == ".toml"]
    given = (static, forces, loads, mass, height, sex, markers, model, calibrate or None)
    if subjects and (len(files) > 1 or any(option is not None for option in given)):
        raise FileError(
            subjects[0], "a subject file contains everything; give it alone, without other files or options"
        )
    overrule = overrule_of(waive)
    osim = [read_osim(path) for path in files if path.suffix.lower() == ".osim"]
    measured = [path for path in files if path.suffix.lower() != ".osim"]
    who = Subject.model_validate({"name": "person", "mass_kg": mass, "height_m": height, "sex": sex})
    person: Person | None
    with shown_progress() as progress, waivers_reported(overrule.waive):
        if subjects:
            person, read = _of_subject_file(subjects[0], progress)
        else:
            expect_one_model(static=static, markers=markers, osim=model, calibrate=calibrate)
            marker_set = None if markers is None else read_marker_set(markers)
            osim_model = None if model is None else read_osim(model)
            stated = Person(who, (), marker_set=marker_set, model=osim_model, calibrate=calibrate, files_only=True)
            named = files_by_name(measured, loads, forces, static)
            person, read = _of_files(named, stated, static, progress)
        checked = _Checked(
            None if person is None else check_person(person.with_overrule(overrule)),
            [check_osim(model_file, who, overrule) for model_file in osim],
            read,
            person.lacking if subjects and person is not None else (),
        )
    recordings = () if checked.person is None else checked.person.recordings
    page = None if output is None else save_check_page(checked.overviews, recordings, checked.models, output)
    with suppress(SystemExit):  # rich's, where nobody reads on (| head)
        _show(checked, page, verbose, overrule.waive)
    return Outcome(_for_scripts(checked), checked.status)


def _of_subject_file(path: Path, progress: Progress) -> tuple[Person, dict[str, str]]:
    """Read the person of a subject file, and list the files of each recording."""
    wanted = read_subject(path, to_fit=False)
    read = {trial.name: _names(trial.markers, trial.forces) for trial in wanted.trials}
    if wanted.model.static is not None:
        read[wanted.model.static.stem] = wanted.model.static.name
    return read_person(wanted, progress), read


def _of_files(
    named: Sequence[RecordingFiles], stated: Person, static: Path | None, progress: Progress
) -> tuple[Person | None, dict[str, str]]:
    """Read the person of files alone, None where there are none, and list the files of each recording."""
    read = {
        name: _names(recorded.markers, recorded.forces)
        for name, recorded in zip(trial_names(named), named, strict=True)
    }
    read |= {} if static is None else {static.stem: static.name}
    person = read_files(named, stated, static, lambda share: progress("reading", share)) if named else None
    return person, read


def _holds_subject_file(path: Path) -> bool:
    return path.is_dir() and any(member.suffix.lower() == ".toml" for member in path.iterdir())


def _names(markers: Path, forces: Path | None) -> str:
    return markers.name if forces is None else f"{markers.name}, {forces.name}"


def _for_scripts(checked: _Checked) -> dict[str, Any]:
    """Return the result for scripts."""
    findings = [finding.to_dict() for overview in checked.overviews for finding in overview.findings]
    recordings = () if checked.person is None else checked.person.recordings
    return {
        "verdict": [overview.verdict for overview in checked.overviews],
        "rules_run": sum(overview.rules for overview in checked.overviews),
        "findings": findings,
        "fit_also_needs": list(checked.lacking),
        "recordings": [
            {"name": recording.context.name, "facts": dict(checked.facts(recording))} for recording in recordings
        ],
        "models": [{"name": model.name, "facts": dict(model.facts.facts())} for model in checked.models],
    }


def _show(checked: _Checked, page: Path | None, verbose: bool, waive: Sequence[str]) -> None:
    """Show the verdict, at most three findings, and with `verbose` all contents of the files."""
    if verbose and checked.person is not None:
        for recording in checked.person.recordings:
            _show_recording(recording, checked.facts(recording))
    for model in checked.models if verbose else ():
        _show_model(model)
    for overview in checked.overviews:
        show_overview(overview, verbose)
    found = [finding for overview in checked.overviews for finding in overview.findings]
    show_idle_waivers(waive, found, ("file", "recording", "person"))
    if checked.lacking:
        out.print(f"kinertia fit also needs, under [subject]: {', '.join(checked.lacking)}", soft_wrap=True)
    if page is not None:
        out.print(f"page in {page}", soft_wrap=True)


def _show_facts(title: str, facts: Sequence[tuple[str, str]]) -> None:
    out.print(f"\n{title}")
    table = Table.grid(padding=(0, 2), expand=False)
    for name, sentence in facts:
        table.add_row(name, sentence)
    out.print(table)


def _show_model(model: ModelOverview) -> None:
    _show_facts(model.name, model.facts.facts())
    table = plain_table(*model.facts.columns)
    for row in model.facts.rows():
        table.add_row(*row)
    out.print(table)


def _show_recording(recording: RecordingCheck, facts: Sequence[tuple[str, str]]) -> None:
    _show_facts(recording.context.name, facts)
    shown = [marker for marker in recording.markers if marker.share < 1.0]
    if shown:
        gaps = plain_table("marker", "seen\n(%)", "longest gap\n(s)")
        for marker in shown:
            gaps.add_row(marker.label, f"{100 * marker.share:.0f}", f"{marker.longest_gap_s:.2f}")
        out.print(gaps)
    if recording.plates:
        plates = plain_table("plate", "foot on plate", "peak\n(N)", "off plate\n(% of load)")
        plates.padding = (0, 1)
        for plate in recording.plates:
            off = "-" if plate.outside_share is None else f"{100 * plate.outside_share:.0f}"
            plates.add_row(plate.name, plate.stood_on(), f"{plate.peak_n:.0f}", off)
        out.print(plates)
