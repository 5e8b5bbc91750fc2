"""The fault study on paper: `faults.md` with the table, `faults.json` with every sentence."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import VERSION
from kinertia.studies.faults import FaultOutcome, SoundWalk

_SHOWN = {"named": "named", "warned": "warned", "harmless": "harmless", "silent": "**silent**", "not possible": "–"}
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

- The other sex: it changes the literature's values by less than people of one sex differ, and no joint moment by more
  than its deviation.
- Turned plates, where markers are noisy: they show in the direction in which they push the body, to a third of a degree
  in most walks, but to 1.6 degrees in the Gait 2354 walk (60 frames a second), where 3 degrees may be chance. The path
  of the centre of pressure under the feet tells less: on sound walks, right and left together, it is up to 4 degrees
  askew to the line from heel to toe.
- A floor that is too low by less than thick soles are high. It is named where the feet's lowest marker is more than
  50 mm above the floor; on fourteen people it is 23 to 44 mm. The forces would show it to 13 to 24 mm: too little.

## What is said of sound walks

{sound}
{laboratories}
"""


def counts(outcomes: Sequence[FaultOutcome]) -> dict[str, int]:
    """How many mistakes came to each outcome; those that are not possible are left out."""
    return {kind: sum(one.outcome == kind for one in outcomes) for kind in _SHOWN if kind != "not possible"}


def faults_markdown(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> str:
    """The table and what it comes to."""
    mistakes = list(dict.fromkeys(one.mistake for one in outcomes))
    by_case = {(one.walk, one.mistake): one for one in outcomes}
    rows = [["mistake", *(walk.name for walk in sound)], ["---"] * (1 + len(sound))]
    rows.append(["nothing: the walk as it is", *(_doubts(walk) for walk in sound)])
    rows += [[name, *(_cell(by_case[walk.name, name]) for walk in sound)] for name in mistakes]
    rows.append(["**named / possible**", *(_named(walk.name, outcomes) for walk in sound)])
    sums = counts(outcomes)
    possible = sum(sums.values())
    summary = (
        f"Of {possible} mistakes made, {sums['named']} are named ({100 * sums['named'] / max(possible, 1):.0f} %), "
        f"{sums['warned']} warned of with another cause, {sums['harmless']} harmless, and {sums['silent']} do silent "
        f"harm. Of {len(sound)} sound walks {_refused(sound)} are refused, and of {len(laboratories)} synthetic people "
        f"in sound laboratories {_refused(laboratories)}."
    )
    return _PAGE.format(
        count=len(mistakes),
        walks=len(sound),
        summary=summary,
        table="\n".join(f"| {' | '.join(cells)} |" for cells in rows),
        sound="\n".join(f"- {walk.name}: {_said(walk)}" for walk in sound),
        laboratories="\n".join(f"- synthetic {walk.name}: {_said(walk)}" for walk in laboratories),
    )


def _doubts(walk: SoundWalk) -> str:
    """How many sentences are said of a sound walk, by whom."""
    said = {by: sum(one.by == by for one in walk.findings) for by in ("check", "fit")}
    return "; ".join(f"{count} by {by}" for by, count in said.items() if count) or "nothing said"


def _refused(walks: Sequence[SoundWalk]) -> int:
    """Of how many `check` says that they fail, or the fit that it is not possible."""
    by_check = [any((one.level, one.by) == ("fail", "check") for one in walk.findings) for walk in walks]
    return sum(refused or walk.moments is None for walk, refused in zip(walks, by_check, strict=True))


def _said(walk: SoundWalk) -> str:
    return "; ".join(f"{one.sentence} ({one.by})" for one in walk.findings) or "nothing"


def _cell(one: FaultOutcome) -> str:
    return _SHOWN[one.outcome] + (" \\*" if one.outcome == "named" and one.by == "fit" else "")


def _named(walk: str, outcomes: Sequence[FaultOutcome]) -> str:
    own = [one for one in outcomes if one.walk == walk and one.outcome != "not possible"]
    return f"**{sum(one.outcome == 'named' for one in own)} / {len(own)}**"


def save_faults(
    sound: Sequence[SoundWalk],
    outcomes: Sequence[FaultOutcome],
    laboratories: Sequence[SoundWalk],
    folder: str | Path,
) -> Path:
    """Write the files into a folder; returns the folder."""
    content = {
        "kinertia": VERSION,
        "sound": {walk.name: [one._asdict() for one in walk.findings] for walk in (*sound, *laboratories)},
        "outcomes": [
            {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in row.items()}
            for row in map(asdict, outcomes)
        ],
    }
    with complete_folder(folder, "faults") as work:
        (work / "faults.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        (work / "faults.md").write_text(faults_markdown(sound, outcomes, laboratories), encoding="utf-8")
    return Path(folder)
