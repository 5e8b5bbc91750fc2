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

## What is said of the walks as they are

{sound}
"""


def counts(outcomes: Sequence[FaultOutcome]) -> dict[str, int]:
    """How many mistakes came to each outcome; those that are not possible are left out."""
    return {kind: sum(one.outcome == kind for one in outcomes) for kind in _SHOWN if kind != "not possible"}


def faults_markdown(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> str:
    """The table and what it comes to."""
    mistakes = list(dict.fromkeys(one.mistake for one in outcomes))
    by_case = {(one.walk, one.mistake): one for one in outcomes}
    rows = [["mistake", *(walk.name for walk in sound)], ["---"] * (1 + len(sound))]
    rows += [[name, *(_cell(by_case[walk.name, name]) for walk in sound)] for name in mistakes]
    rows.append(["**named / possible**", *(_named(walk.name, outcomes) for walk in sound)])
    sums = counts(outcomes)
    possible = sum(sums.values())
    refused = [walk.name for walk in sound if any(one.level == "fail" and one.by == "check" for one in walk.findings)]
    summary = (
        f"Of {possible} mistakes made, {sums['named']} are named ({100 * sums['named'] / max(possible, 1):.0f} %), "
        f"{sums['warned']} warned of with another cause, {sums['harmless']} harmless, and {sums['silent']} do silent "
        f"harm. Sound walks that `check` refuses: {len(refused)} of {len(sound)}."
    )
    lines = []
    for walk in sound:
        said = [one for one in walk.findings if one.by == "check"]
        lines.append(f"- {walk.name}: " + ("; ".join(one.sentence for one in said) if said else "nothing"))
    return _PAGE.format(
        count=len(mistakes),
        walks=len(sound),
        summary=summary,
        table="\n".join(f"| {' | '.join(cells)} |" for cells in rows),
        sound="\n".join(lines),
    )


def _cell(one: FaultOutcome) -> str:
    return _SHOWN[one.outcome] + (" \\*" if one.outcome == "named" and one.by == "fit" else "")


def _named(walk: str, outcomes: Sequence[FaultOutcome]) -> str:
    own = [one for one in outcomes if one.walk == walk and one.outcome != "not possible"]
    return f"**{sum(one.outcome == 'named' for one in own)} / {len(own)}**"


def save_faults(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], folder: str | Path) -> Path:
    """Write the files into a folder; returns the folder."""
    content = {
        "kinertia": VERSION,
        "sound": {walk.name: [one._asdict() for one in walk.findings] for walk in sound},
        "outcomes": [
            {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in row.items()}
            for row in map(asdict, outcomes)
        ],
    }
    with complete_folder(folder, "faults") as work:
        (work / "faults.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        (work / "faults.md").write_text(faults_markdown(sound, outcomes), encoding="utf-8")
    return Path(folder)
