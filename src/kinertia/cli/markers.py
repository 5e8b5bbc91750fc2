"""Defines `kinertia markers`: identifies the marker set of a recording, or drafts one."""

from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.cli.outcome import Outcome
from kinertia.cli.terminal import out, plain_table
from kinertia.errors import FileError
from kinertia.io.marker_set_draft import draft_marker_set, preset_of
from kinertia.io.marker_set_file import nearest_preset, preset_name, preset_names, read_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.results.output_folder import write_then_rename
from kinertia.model.marker_set import fits_person, label_share, spelled_as
from kinertia.trial.data import Recording
from kinertia.trial.marker_quality import STILL_M_S, speed_m_s

_LISTED = 6


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
    shares = {name: label_share(one, labels) for name, one in sets.items()}
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
