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

## What cannot be named

- The other sex: it changes the literature's values by less than people of one sex differ. Joint moments change by 0.3
  to 0.7 of their deviations, in one of seven walks by 1.4.
- Turned plates, where markers are noisy: they show in the direction in which they push the body, to a third of a degree
  in most walks, but to 1.6 degrees in the Gait 2354 walk (60 frames a second), where 3 degrees may be chance and change
  moments by twice their deviations. A note of the fit then says from which angle on its trials show a turn. The path of
  the centre of pressure under the feet tells less: on sound walks, right and left together, it is up to 4 degrees askew
  to the line from heel to toe.
- A floor that is too low by less than thick soles are high. It is named where the feet's lowest marker is more than
  50 mm above the floor; on fourteen people it is 23 to 44 mm. The forces would show it to 13 to 24 mm: too little.
- A wrong rate of a C3D file by less than a factor of 1.8. Markers and forces share its clock, so that loads still begin
  when feet land. Only the body's ups and downs show it: at 1.2 times the rate forces move it 0.7 times as fast as its
  markers show in the Plug-in Gait walk of subject A, and 0.8 to 1.05 times (by the markers' centre) on sound trials.
- A zero of one loaded plate, or a gain by less than 7.5 %, in less than a second of measured steps: its share of so
  short a motion is not told from what pelvis and limbs do against one another.
- What is told by another cause, or hardly: somebody else's foot on a plate, a step over its edge and cameras that are
  tilted to the side (gains and places of plates are doubted), free moments that are too large, forces of another trial
  of the same person (a rate), and another scale of the cameras in static trial and walk alike (places of plates). Of an
  origin of the plates 40 mm too deep nothing is said, and moments change by 1.2 to 3 deviations; nor always of centres
  of pressure that were filtered later than the forces, or of half of the cameras' volume that is 15 to 30 mm higher.
- Of a person's own OpenSim model: joint centres or axes that are off on both sides alike by 20 to 30 mm or 15 degrees,
  markers of both feet that are 20 mm too far forward in the model, and bones that are 5 to 10 % too long or short with
  markers placed on the person. Joint moments change by 5 to 14 N m, more than their deviations, which take a model's
  joints as exact, or with `--calibrate` as known to a centimetre. Nor, with such a model, of markers that are 20 mm
  further along the walkway than the plates (7 to 11 N m).
- Forces that were low-passed at 5 Hz and set to zero below a threshold afterwards. Without the threshold the filter's
  ringing beside each load tells them. What is left under the feet does not: of sound walks, too, 2 to 10 % of the
  energy of the force's changes is above 6 Hz, and of walks filtered at 5 Hz 1 to 4 %; loads begin and end within 20 ms
  of when they did; and between 3 and 7 Hz sound forces move the body 0.4 to 1.3 times as fast as the markers show,
  filtered ones 0.2 to 1.0 times.

## What is said of sound walks

{sound}
"""


def counts(outcomes: Sequence[FaultOutcome]) -> dict[str, int]:
    """How many mistakes came to each outcome; those that are not possible are left out."""
    return {kind: sum(one.outcome == kind for one in outcomes) for kind in _BARS}


def faults_markdown(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> str:
    """The table and what it comes to."""
    rows = [["mistake", *(walk.name for walk in sound)], ["---"] * (1 + len(sound)), *faults_rows(sound, outcomes)]
    emphasised = {"silent": "**silent**", "named*": "named \\*"}
    *most, last = [[row[0], *(emphasised.get(cell, cell) for cell in row[1:])] for row in rows]
    return _PAGE.format(
        count=len(rows) - 4,
        walks=len(sound),
        summary=faults_sentence(sound, outcomes, laboratories),
        table="\n".join(f"| {' | '.join(cells)} |" for cells in (*most, [f"**{cell}**" for cell in last])),
        sound="\n".join(f"- {sentence}" for sentence in _said_of_sound([*sound, *laboratories])),
    )


def faults_rows(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> list[list[str]]:
    """One row per mistake, a column per walk; the first row is of no mistake, the last one counts those named among
    those possible.
    """
    by_case = {(one.walk, one.mistake): one for one in outcomes}
    mistakes = dict.fromkeys(one.mistake for one in outcomes)
    rows = [[name, *(_cell(by_case[walk.name, name]) for walk in sound)] for name in mistakes]
    rows.insert(0, ["none: the walk as it is", *(_doubts(walk) for walk in sound)])
    return [*rows, ["named / possible", *(_named(walk.name, outcomes) for walk in sound)]]


def faults_sentence(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> str:
    """What the table comes to."""
    sums = counts(outcomes)
    possible = sum(sums.values())
    return (
        f"Of {possible} mistakes made, {sums['named']} are named ({100 * sums['named'] / max(possible, 1):.0f} %), "
        f"{sums['warned']} warned of with another cause, {sums['harmless']} harmless, and {sums['silent']} do silent "
        f"harm. Of {len(sound)} sound walks {_refused(sound)} are refused. Of {len(laboratories)} other synthetic "
        f"people in sound laboratories {_refused(laboratories)} are refused, and something is said of "
        f"{_doubted(laboratories)}."
    )


def _doubts(walk: SoundWalk) -> str:
    """How many sentences are said of a sound walk, by whom."""
    said = {by: sum(one.by == by for one in walk.findings) for by in ("check", "fit")}
    return "; ".join(f"{count} by {by}" for by, count in said.items() if count) or "nothing said"


def _refused(walks: Sequence[SoundWalk]) -> int:
    """Of how many `check` says that they fail, or the fit that it is not possible."""
    by_check = [any((one.level, one.by) == ("fail", "check") for one in walk.findings) for walk in walks]
    return sum(refused or walk.moments is None for walk, refused in zip(walks, by_check, strict=True))


def _doubted(walks: Sequence[SoundWalk]) -> int:
    return sum(bool(walk.findings) for walk in walks)


def _said_of_sound(sound: Sequence[SoundWalk]) -> list[str]:
    """What `check` and the fit say of walks as they are."""
    said = ("; ".join(f"{one.sentence} ({one.by})" for one in walk.findings) or "nothing" for walk in sound)
    return [f"{walk.name}: {sentences}" for walk, sentences in zip(sound, said, strict=True)]


def render_faults(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> str:
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
        Part("What is said of sound walks", listed=_said_of_sound([*sound, *laboratories])),
    ]
    return render_parts("Which mistakes are named?", faults_sentence(sound, outcomes, laboratories), parts)


def _cell(one: FaultOutcome) -> str:
    if one.outcome == "not possible":
        return "–"
    return one.outcome + ("*" if one.outcome == "named" and one.by == "fit" else "")


def _named(walk: str, outcomes: Sequence[FaultOutcome]) -> str:
    own = [one for one in outcomes if one.walk == walk and one.outcome != "not possible"]
    return f"{sum(one.outcome == 'named' for one in own)} / {len(own)}"


def save_faults(
    sound: Sequence[SoundWalk],
    outcomes: Sequence[FaultOutcome],
    laboratories: Sequence[SoundWalk],
    folder: str | Path,
) -> Path:
    """Write the files into a folder; returns the folder."""
    with complete_folder(folder, "faults") as work:
        text = json.dumps(faults_summary(sound, outcomes, laboratories), indent=1)
        (work / "faults.json").write_text(text + "\n", encoding="utf-8")
        (work / "faults.md").write_text(faults_markdown(sound, outcomes, laboratories), encoding="utf-8")
        (work / "faults.html").write_text(render_faults(sound, outcomes, laboratories), encoding="utf-8")
    return Path(folder)


def faults_summary(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> dict[str, Any]:
    """What `faults.json` says."""
    return {
        "kinertia": VERSION,
        "sound": {walk.name: [one._asdict() for one in walk.findings] for walk in (*sound, *laboratories)},
        "outcomes": [
            {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in row.items()}
            for row in map(asdict, outcomes)
        ],
    }
