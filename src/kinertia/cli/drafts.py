"""Defines `kinertia init` and `kinertia markers`: drafts of a subject file and of a marker set."""

import os
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.cli.common import Height, Mass, Outcome, Sex, number, out, plain_table
from kinertia.cli.common import sex as parsed_sex
from kinertia.errors import FileError, missing_file
from kinertia.findings.quantity import Limit
from kinertia.io.file_names import command_line
from kinertia.io.marker_set_draft import draft_marker_set, preset_of
from kinertia.io.marker_set_file import nearest_preset, preset_name, preset_names, read_marker_set
from kinertia.io.output_folder import write_then_rename
from kinertia.io.recording import read_recording
from kinertia.io.subject.body_files import measures_sheet
from kinertia.io.subject.draft import FILL_IN, MARKER_SET, NO_FORCES, NOT_USED, SUBJECT, init_files
from kinertia.model.anthropometry import BODY_MASS_KG, STATURE_M
from kinertia.model.marker_set import fits_person, label_share, spelled_as
from kinertia.report.figures.measures_picture import measures_picture
from kinertia.trial.data import Recording
from kinertia.trial.marker_quality import STILL_M_S, speed_m_s

_LISTED = 6


def init(
    folder: Annotated[Path, typer.Argument(help="One person's folder, or any file in it.")],
    sex: Sex = None,
    age: Annotated[float | None, typer.Option(parser=number, metavar="YEARS", help="Age, years.")] = None,
    mass: Mass = None,
    height: Height = None,
    condition: Annotated[
        list[str] | None,
        typer.Option(metavar="TRIAL=NAME", help="Condition of a trial; may be repeated."),
    ] = None,
    measures: Annotated[
        bool, typer.Option("--measures", help="Write the sheet of girths and lengths to fill in, and no subject.toml.")
    ] = False,
) -> Outcome:
    """Write a first subject.toml from the files in a folder.

    In a terminal it asks for what is not known of the person and for
    conditions; Enter skips.

    Where no marker-set preset fits the static trial, a draft of one,
    markers.toml, is written beside it.

    A completed sheet of girths and lengths in the folder is used. --measures
    writes an empty one, measures.csv, with a picture of where to measure,
    measures.svg.

    [bold]Example[/]

    kinertia init data/subject01 --sex f --age 9 --condition walk1=barefoot
    """
    folder = folder.parent if folder.is_file() else folder
    if measures:
        return _measures(folder)
    path, drafted = folder / SUBJECT, folder / MARKER_SET
    if path.exists():
        raise FileError(path, "already exists and was not changed; remove it to draft a new one")
    if folder.is_dir() and not os.access(folder, os.W_OK):
        raise FileError(folder, "cannot be written to; copy the files into a folder of your own, and draft it there")
    given = {"sex": sex, "mass_kg": mass, "height_m": height, "age_years": age}
    stated: dict[str, object] = {key: value for key, value in given.items() if value is not None}
    conditions = _conditions(condition or ())
    files = init_files(folder, stated=stated, conditions=conditions)
    content = tomllib.loads(files[SUBJECT])
    if _in_terminal():
        out.print(f"{_found(content)} Press Enter to skip a question.", soft_wrap=True)
        stated |= _asked(content.get("subject", {}))
        conditions |= _asked_conditions(content.get("trial", []), conditions)
        files = init_files(folder, stated=stated, conditions=conditions)
    _expect_trials(conditions, content.get("trial", []))
    for name, text in sorted(files.items()):
        write_then_rename(folder / name, text)
    lines = files[SUBJECT].splitlines()
    notes = [line.removeprefix("# ") for line in lines if line.startswith(NO_FORCES)]
    for note in notes:
        out.print(note, soft_wrap=True)
    if MARKER_SET in files:
        against = next((line.partition(NOT_USED)[2] for line in lines if NOT_USED in line), "")
        check = f"it is not used: {against} and remove the # before markers" if against else "check it"
        out.print(
            f"no marker-set preset fits: wrote {drafted}, drafted from the marker positions; {check}", soft_wrap=True
        )
    check = command_line(["kinertia", "check", str(path)])
    asked = [line.removeprefix("# ").partition(" =")[0] for line in lines if FILL_IN in line and " =" in line]
    fill_in = f"fill in {', '.join(dict.fromkeys(asked))}, then run" if asked else "now run"
    out.print(f"wrote {path}: {fill_in}: {check}", soft_wrap=True)
    marker_set = str(drafted) if MARKER_SET in files else None
    return Outcome({"subject_file": str(path), "marker_set": marker_set, "fill_in": asked, "notes": notes})


def _in_terminal() -> bool:
    """Return whether there is somebody to answer."""
    return sys.stdin.isatty() and sys.stdout.isatty() and not out.quiet


def _found(content: Mapping[str, Any]) -> str:
    """Name the trials and the static trial of a draft, in a sentence."""
    names = [Path(trial["markers"]).stem for trial in content.get("trial", [])]
    listed = ", ".join(names[:_LISTED]) + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "")
    static = content.get("model", {}).get("static")
    return f"Trials: {listed or 'none'}. Static trial: {Path(static).stem if static else 'none'}."


def _from(limits: tuple[Limit, Limit]) -> Callable[[str], float]:
    """Return a parser of numbers that refuses those beyond these limits, such as a stature in centimetres."""

    def parse(text: str) -> float:
        value, (least, most) = number(text), limits
        if not least <= value <= most:
            raise typer.BadParameter(f"{value:g} is not between {least:g} and {most:g} {least.unit}")
        return value

    return parse


_QUESTIONS: Mapping[str, tuple[str, Callable[[str], object]]] = {
    "sex": ("Sex, male or female (m, f)", parsed_sex),
    "age_years": ("Age, years", number),
    "mass_kg": ("Body mass, kg", _from(BODY_MASS_KG)),
    "height_m": ("Stature, m, such as 1.68", _from(STATURE_M)),
}


def _asked(known: Mapping[str, object]) -> dict[str, object]:
    """Ask for what is not known of the person; an empty answer leaves it open."""
    answers: dict[str, object] = {}
    for key, (question, parse) in _QUESTIONS.items():
        while key not in known and key not in answers:
            text = typer.prompt(question, default="", show_default=False).strip()
            if not text:
                break
            try:
                answers[key] = parse(text)
            except typer.BadParameter as error:
                out.print(error.message)
    return answers


def _asked_conditions(trials: Sequence[Mapping[str, str]], known: Mapping[str, str]) -> dict[str, str]:
    """Ask for the condition of each trial, where there are several."""
    names = [Path(trial["markers"]).stem for trial in trials]
    if known or len(names) < 2:
        return {}
    answers = {name: typer.prompt(f"Condition of {name}", default="", show_default=False).strip() for name in names}
    return {name: text for name, text in answers.items() if text}


def _conditions(given: Sequence[str]) -> dict[str, str]:
    """Parse conditions given as TRIAL=NAME.

    Raises:
        BadParameter: one lacks its trial or its name.
    """
    pairs = [condition.partition("=")[::2] for condition in given]
    for (trial, name), text in zip(pairs, given, strict=True):
        if not trial.strip() or not name.strip():
            raise typer.BadParameter(f"'{text}' is no condition of a trial; write it as walk1=barefoot")
    return {trial.strip(): name.strip() for trial, name in pairs}


def _expect_trials(conditions: Mapping[str, str], trials: Sequence[Mapping[str, str]]) -> None:
    """Raise an error about a condition of a trial that is not in the folder."""
    names = [Path(trial["markers"]).stem for trial in trials]
    if unknown := [trial for trial in conditions if trial not in names]:
        raise typer.BadParameter(f"there is no trial '{unknown[0]}'; trials are {', '.join(names)}")


def _measures(folder: Path) -> Outcome:
    sheet, picture = folder / "measures.csv", folder / "measures.svg"
    if not folder.is_dir():
        raise FileError.found(folder, "F101", **missing_file(folder, str(folder), "the person's folder", True))
    if sheet.exists():
        raise FileError(sheet, "already exists and was not changed; remove it to write a new one")
    write_then_rename(picture, measures_picture())
    write_then_rename(sheet, measures_sheet())
    init_again = command_line(["kinertia", "init", str(folder)])
    out.print(
        f"wrote {sheet}: fill in the column cm for what you measure ({picture} shows where). Then {init_again} "
        'uses it; a subject file that exists already needs measures = "measures.csv" under [prior]',
        soft_wrap=True,
    )
    return Outcome({"sheet": str(sheet), "picture": str(picture)})


def markers(
    file: Annotated[Path, typer.Argument(help="A recording (.c3d, .trc, .tsv, .csv), preferably the static trial.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File (.toml) to which a draft of your own marker set is written."),
    ] = None,
) -> Outcome:
    """Show the labels of a file against every marker-set preset, and draft a marker set from them.

    A preset fits if the file has at least two thirds of its labels, or of its labels on pelvis, legs and feet. For any
    other set, give the static trial and -o: Kinertia finds landmarks by their positions on the standing person and
    uses labels as hints. Check the draft, then pass it with --markers.

    [bold]Examples[/]

    kinertia markers static.c3d

    kinertia markers static.c3d -o our_lab.toml
    """
    recording = read_recording(file)
    if speed_m_s(recording.markers) < STILL_M_S:
        recording = read_recording(file, standing=True)
    recording = recording.without_empty_markers()
    labels = recording.markers.labels
    out.print(f"{len(labels)} labels: {', '.join(labels)}", soft_wrap=True)
    table = plain_table("preset", "labels present", "absent")
    sets = {name: spelled_as(read_marker_set(name), labels) for name in preset_names()}
    shares = {name: label_share(marker_set, labels) for name, marker_set in sets.items()}
    presets = []
    for name in sorted(shares, key=lambda name: -shares[name]):
        wanted = sets[name].labels
        absent = [label for label in wanted if label not in labels]
        more = f" and {len(absent) - _LISTED} more" if len(absent) > _LISTED else ""
        table.add_row(name, f"{len(wanted) - len(absent)} of {len(wanted)}", ", ".join(absent[:_LISTED]) + more)
        presets.append({"name": name, "labels": len(wanted), "absent": absent})
    out.print(table)
    best = nearest_preset(labels)
    recognised = preset_name(best) if fits_person(best, labels) else None
    if recognised:
        out.print(f"{recognised} is recognised by itself", soft_wrap=True)
        if speed_m_s(recording.markers) < STILL_M_S and preset_of(recording) is None:
            out.print(
                "but this static trial lacks some of its landmarks: draft one of your own with -o", soft_wrap=True
            )
    elif output is None:
        out.print("no preset fits these labels; to draft your own: -o our_lab.toml", soft_wrap=True)
    content = {"labels": labels, "presets": presets, "recognised": recognised, "draft": None}
    return Outcome(content if output is None else {**content, **_draft(recording, output)})


def _draft(recording: Recording, output: Path) -> dict[str, Any]:
    """Write a draft, and report what it lacks."""
    if output.exists():
        raise FileError(output, "already exists and was not changed; remove it, or give another name")
    draft = draft_marker_set(recording, output.stem)
    write_then_rename(output, draft.text)
    for note in draft.notes:
        out.print(f"note: {note}", soft_wrap=True)
    if draft.needed:
        out.print(f"not found, and needed: {', '.join(draft.needed)}", soft_wrap=True)
    out.print(f"wrote {output}: check it, complete what it asks for, then give it as --markers", soft_wrap=True)
    return {"draft": str(output), "needed": list(draft.needed), "notes": list(draft.notes)}
