"""The fault study on paper: a page, `faults.md` with the table, `faults.json` with every sentence."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import VERSION
from kinertia.report.result_page import Part, render_parts
from kinertia.report.row_figures import bar_figure
from kinertia.studies.faults import FaultOutcome, SoundWalk

_BARS = ("named", "warned", "harmless", "silent")
_PAGE = """# Which mistakes are named?

Laboratories make mistakes: swapped labels, a wrong axis, another person's static trial. Each of {count} known ones was
made in the files of {walks} walks, one at a time, and given to `kinertia check`; what it did not doubt was fitted.
`kinertia study faults` does so, with your own walks as well, and writes this page.

- **named**: the first new sentence names the cause (by `check` or, marked \\*, by the fit)
- **warned**: something new is said, but of another cause
- **harmless**: nothing is said, and no joint moment of the legs changes by more than its standard deviation (RMS)
- **silent**: nothing is said, and one does
- –: the walk has nothing to make the mistake with (Plug-in Gait has no inner markers, force files have no plates)

{summary}

{table}

Sentences and changes of the joint moments are in `faults.json`.

## What is said of the walks as they are

{sound}
"""


def counts(outcomes: Sequence[FaultOutcome]) -> dict[str, int]:
    """How many mistakes came to each outcome; those that are not possible are left out."""
    return {kind: sum(one.outcome == kind for one in outcomes) for kind in _BARS}


def faults_markdown(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> str:
    """The table and what it comes to."""
    rows = [["mistake", *(walk.name for walk in sound)], ["---"] * (1 + len(sound)), *faults_rows(sound, outcomes)]
    emphasised = {"silent": "**silent**", "named*": "named \\*"}
    *most, last = [[row[0], *(emphasised.get(cell, cell) for cell in row[1:])] for row in rows]
    return _PAGE.format(
        count=len(rows) - 3,
        walks=len(sound),
        summary=faults_sentence(sound, outcomes),
        table="\n".join(f"| {' | '.join(cells)} |" for cells in (*most, [f"**{cell}**" for cell in last])),
        sound="\n".join(f"- {sentence}" for sentence in _said_of_sound(sound)),
    )


def faults_rows(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> list[list[str]]:
    """One row per mistake, a column per walk; the last row counts those named among those possible."""
    by_case = {(one.walk, one.mistake): one for one in outcomes}
    mistakes = dict.fromkeys(one.mistake for one in outcomes)
    rows = [[name, *(_cell(by_case[walk.name, name]) for walk in sound)] for name in mistakes]
    return [*rows, ["named / possible", *(_named(walk.name, outcomes) for walk in sound)]]


def faults_sentence(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> str:
    """What the table comes to."""
    sums = counts(outcomes)
    possible = sum(sums.values())
    refused = [walk.name for walk in sound if any(one.level == "fail" and one.by == "check" for one in walk.findings)]
    return (
        f"Of {possible} mistakes made, {sums['named']} are named ({100 * sums['named'] / max(possible, 1):.0f} %), "
        f"{sums['warned']} warned of with another cause, {sums['harmless']} harmless, and {sums['silent']} do silent "
        f"harm. Sound walks that `check` refuses: {len(refused)} of {len(sound)}."
    )


def _said_of_sound(sound: Sequence[SoundWalk]) -> list[str]:
    """What `check` says of the walks as they are."""
    lines = []
    for walk in sound:
        said = [one for one in walk.findings if one.by == "check"]
        lines.append(f"{walk.name}: " + ("; ".join(one.sentence for one in said) if said else "nothing"))
    return lines


def render_faults(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> str:
    """The page."""
    names = [walk.name for walk in sound]
    sums = [counts([one for one in outcomes if one.walk == name]) for name in names]
    figure = bar_figure(
        names,
        {kind: [one[kind] for one in sums] for kind in _BARS},
        "How many mistakes in each walk are named, warned of, harmless or silent.",
        "mistakes that are possible in this walk",
    )
    words = (
        "Named: the first new sentence names the cause (by check or, marked *, by the fit). Warned: something new is "
        "said, but of another cause. Harmless: nothing is said, and no joint moment of the legs changes by more than "
        "its standard deviation. Silent: nothing is said, and one does. –: the walk has nothing to make it with."
    )
    rows = faults_rows(sound, outcomes)
    parts = [
        Part("Outcomes", (words,), figure, headings=("mistake", *names), rows=rows),
        Part("What is said of the walks as they are", listed=_said_of_sound(sound)),
    ]
    return render_parts("Which mistakes are named?", faults_sentence(sound, outcomes).replace("`", ""), parts)


def _cell(one: FaultOutcome) -> str:
    if one.outcome == "not possible":
        return "–"
    return one.outcome + ("*" if one.outcome == "named" and one.by == "fit" else "")


def _named(walk: str, outcomes: Sequence[FaultOutcome]) -> str:
    own = [one for one in outcomes if one.walk == walk and one.outcome != "not possible"]
    return f"{sum(one.outcome == 'named' for one in own)} / {len(own)}"


def save_faults(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], folder: str | Path) -> Path:
    """Write the files into a folder; returns the folder."""
    with complete_folder(folder, "faults") as work:
        text = json.dumps(faults_summary(sound, outcomes), indent=1)
        (work / "faults.json").write_text(text + "\n", encoding="utf-8")
        (work / "faults.md").write_text(faults_markdown(sound, outcomes), encoding="utf-8")
        (work / "faults.html").write_text(render_faults(sound, outcomes), encoding="utf-8")
    return Path(folder)


def faults_summary(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> dict[str, Any]:
    """What `faults.json` says."""
    return {
        "kinertia": VERSION,
        "sound": {walk.name: [one._asdict() for one in walk.findings] for walk in sound},
        "outcomes": [
            {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in row.items()}
            for row in map(asdict, outcomes)
        ],
    }
