"""Inject known faults into files: which are identified?"""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import typer

from kinertia.findings.finding import Severity
from kinertia.findings.overview import reported
from kinertia.findings.rule import rule
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import SubjectFile
from kinertia.io.versions import VERSION
from validation.fault_study import FaultOutcome, SoundWalk, run_faults, run_sound, sound_laboratories, synthetic_walk
from validation.measured_data import data_folder
from validation.page import write_page
from validation.walks import subject_files

_CODE_HEADINGS = ("code", "finding", "identified", "warned", "fault-free walks")
SOUND_LABORATORIES = 10
_OUTCOMES = ("identified", "warned", "harmless", "unnoticed")
_PAGE = """# Which faults are identified?

Laboratories make mistakes: swapped labels, a wrong axis, another person's static trial. Each of {count} known ones was
made in the files of {walks} walks, one at a time, and given to `kinertia check`; what it did not identify was fitted.
`python -m validation faults SUBJECT ...` does so with your own walks.

- **identified**: a new open finding has a code of the fault (by `check` or, marked \\*, by the fit, which may
  correct it)
- **warned**: new findings have other codes only
- **harmless**: nothing is new, and no joint moment of the legs changes by more than its standard deviation (RMS)
- **unnoticed**: nothing is new, and one does
- –: the walk has nothing to make the fault with (Plug-in Gait has no medial markers, force files have no plates)

{summary}

{table}

## By code

{codes}

## What cannot be identified

- The other sex: its effect on the literature's values is smaller than the differences between people of one sex.
  Joint moments change by 0.3 to 0.7 of their SDs, in one of seven walks by 1.4.
- Rotated plates, if markers are noisy: rotations show in the direction in which the plates accelerate the body,
  within a third of a degree in most walks, but within 1.6 degrees in the Gait 2354 walk (60 frames a second), where 3
  degrees may be chance and change moments by two SDs. A note of the fit then states from which angle on its trials
  show a rotation. The path of the centre of pressure under the feet shows less: on fault-free walks, right and left
  together, it is up to 4 degrees from the line between heel and toe. Where 3 degrees of all plates or 5 of one go
  unnoticed, moments change by 1.0 to 1.3 SDs (2 to 4 N m).
- A wrong height of the plates, if the file does not state it: P249 compares the corners in a C3D file, or the heights
  of the points in a force file, with the feet. Where points computed for a surface 50 mm higher are at 0 in the file,
  moments change by 1.4 to 1.8 SDs (2 to 4 N m). Estimated with everything else, the height has an SD of 13 to 24 mm,
  and is -39 to 8 mm in nine fault-free walks.
- A late plate, where a foot reaches over its edge (P282): the load that is missing has the same effect. In the
  Plug-in Gait walk of subject B one plate seems 10 ms early as it is, and 10 ms late with 25 ms; moments change by 2.4
  SDs (4 N m).
- The same wrong camera scale in static trial and walk: with 2 %, a person seems 30 mm taller than stated, and people of
  one stature differ by more. Moments change by 1.1 to 1.4 SDs (1 to 2 N m).
- Errors of forces, if all contact is measured for less than 0.4 s, as in one step on one plate (P291 says so): in the
  walk of Clinic MH, 5 % of crosstalk, a vertical 5 degrees off and a rate 10 % off change moments by 18 to 22 N m (3 to
  4 SDs), plates 50 mm off along the foot by 32 N m.
- A floor that is too low by less than the height of thick soles. It is identified if the feet's lowest marker is more
  than 50 mm above the floor; on fourteen people it is 23 to 44 mm. The forces would show it within 13 to 24 mm: too
  little.
- A wrong rate of a C3D file by less than a factor of 1.8. Markers and forces share its time base, so loads still
  begin at foot contact. Only the vertical motion shows it: at 1.2 times the rate forces move the body 0.7 times as
  fast as the markers show in the Plug-in Gait walk of subject A, and 0.8 to 1.05 times (marker-based centre) on
  fault-free trials.
- A zero offset of one loaded plate, or a gain error below 7.5 %, in less than a second of measured steps: its effect
  cannot be distinguished from the motion of pelvis and limbs relative to each other.
- Faults reported with another cause, or hardly at all: another person's foot on a plate, a step over its edge and
  cameras tilted sideways (reported as gains and positions of plates), free moments that are too large, and forces of
  another trial of the same person (as a rate). An origin of the plates 40 mm too deep is not reported, and moments
  change by 1.2 to 3 SDs; nor always are centres of pressure that were filtered later than the forces, or half of the
  cameras' volume being 15 to 30 mm higher.
- In a person's own OpenSim model: joint centres or axes displaced on both sides equally by 20 to 30 mm or 15 degrees,
  markers of both feet that are 20 mm too far forward in the model, and bones that are 5 to 10 % too long or short
  with markers placed on the person. Joint moments change by 5 to 14 N m, more than their SDs, which take a model's
  joints as exact, or with `--calibrate` as known to a centimetre. Nor, with such a model, markers that are 20 mm
  further along the walkway than the plates (7 to 11 N m).
- Forces that were low-passed at 10 to 15 Hz (-3 dB). Below 10 Hz, P108 reports 95 % of 37 recordings filtered at 8 Hz
  and 60 % of those filtered at 10 Hz, by what contacts lack. Above, a filter cannot be distinguished from somebody who
  lands softly; moments change by 0.2 to 1.6 SDs at 10 Hz, and at 16 Hz by 0.1 to 1.0.

## What is found in fault-free walks

{sound}
"""


def counts(outcomes: Sequence[FaultOutcome]) -> dict[str, int]:
    """Count faults by outcome; impossible ones are left out."""
    return {kind: sum(outcome.outcome == kind for outcome in outcomes) for kind in _OUTCOMES}


def faults_markdown(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> str:
    """Return the tables and their summary."""
    emphasised = {"unnoticed": "**unnoticed**", "identified*": "identified \\*"}
    *most, last = [[row[0], *(emphasised.get(cell, cell) for cell in row[1:])] for row in faults_rows(sound, outcomes)]
    return _PAGE.format(
        count=len(most) - 1,
        walks=len(sound),
        summary=faults_sentence(sound, outcomes, laboratories),
        table=_table(["fault", *(walk.name for walk in sound)], [*most, [f"**{cell}**" for cell in last]]),
        codes=_table(_CODE_HEADINGS, code_rows([*sound, *laboratories], outcomes)),
        sound="\n".join(f"- {sentence}" for sentence in _findings_of_sound([*sound, *laboratories])),
    )


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (headings, ["---"] * len(headings), *rows))


def code_rows(fault_free: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> list[list[str]]:
    """Return a row for each code: how many faults it identifies, for how many it is the first other finding, and in how
    many fault-free walks it is found.
    """
    named, warned = (
        Counter(finding.code for finding in outcomes if finding.outcome == kind) for kind in ("identified", "warned")
    )
    without = Counter(code for walk in fault_free for code in {finding.code for finding in reported(walk.findings)})
    codes = sorted({*named, *warned, *without} - {""})
    return [[code, rule(code).name, str(named[code]), str(warned[code]), str(without[code])] for code in codes]


def faults_rows(sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome]) -> list[list[str]]:
    """Return one row per fault, a column per walk; the first row is fault-free, the last one counts those identified
    among those possible.
    """
    by_case = {(outcome.walk, outcome.mistake): outcome for outcome in outcomes}
    mistakes = dict.fromkeys(outcome.mistake for outcome in outcomes)
    rows = [[name, *(_cell(by_case[walk.name, name]) for walk in sound)] for name in mistakes]
    rows.insert(0, ["none: the walk as it is", *(_codes(walk) for walk in sound)])
    return [*rows, ["identified / possible", *(_named(walk.name, outcomes) for walk in sound)]]


def faults_sentence(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> str:
    """Summarise the table in a sentence."""
    sums = counts(outcomes)
    possible = sum(sums.values())
    return (
        f"Of {possible} faults, {sums['identified']} are identified "
        f"({100 * sums['identified'] / max(possible, 1):.0f} %), {sums['warned']} reported with other codes, "
        f"{sums['harmless']} harmless, and {sums['unnoticed']} unnoticed. "
        f"Of {len(sound)} fault-free walks {_count(sound, Severity.ERROR)} are blocked, and "
        f"{_count(sound, Severity.WARNING)} have a warning. Of {len(laboratories)} other people in fault-free "
        f"synthetic laboratories {_count(laboratories, Severity.ERROR)} are blocked, and "
        f"{_count(laboratories, Severity.WARNING)} have a warning."
    )


def _codes(walk: SoundWalk) -> str:
    """Return the codes found in a fault-free walk, the worst first."""
    return " ".join(dict.fromkeys(finding.code for finding in reported(walk.findings))) or "none"


def _count(walks: Sequence[SoundWalk], least: Severity) -> int:
    """Count walks with a finding at least as severe; a walk that cannot be fitted is blocked."""
    return sum(
        walk.moments is None or any(finding.severity >= least for finding in reported(walk.findings)) for walk in walks
    )


def _findings_of_sound(sound: Sequence[SoundWalk]) -> list[str]:
    """List the findings in fault-free walks."""
    found = (
        "; ".join(f"{finding.code} {finding.message}" for finding in reported(walk.findings)) or "nothing"
        for walk in sound
    )
    return [f"{walk.name}: {sentences}" for walk, sentences in zip(sound, found, strict=True)]


def _cell(fault_outcome: FaultOutcome) -> str:
    if fault_outcome.outcome == "not possible":
        return "–"
    return fault_outcome.outcome + ("*" if fault_outcome.outcome == "identified" and fault_outcome.by == "fit" else "")


def _named(walk: str, outcomes: Sequence[FaultOutcome]) -> str:
    of_walk = [outcome for outcome in outcomes if outcome.walk == walk and outcome.outcome != "not possible"]
    return f"{sum(outcome.outcome == 'identified' for outcome in of_walk)} / {len(of_walk)}"


def faults_summary(
    sound: Sequence[SoundWalk], outcomes: Sequence[FaultOutcome], laboratories: Sequence[SoundWalk]
) -> dict[str, Any]:
    """Return every finding, and the changes of the joint moments."""
    return {
        "kinertia": VERSION,
        "sound": {walk.name: [finding.to_dict() for finding in walk.findings] for walk in (*sound, *laboratories)},
        "outcomes": [
            {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in row.items()}
            for row in map(asdict, outcomes)
        ],
    }


def main(
    walks: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[SUBJECT]...", help="Subject files in place of the measured walks: the page is printed."
        ),
    ] = None,
    details: Annotated[Path | None, typer.Option(help="Write every finding to this JSON file.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes (default: one per core).")] = None,
) -> None:
    """Inject every fault into every walk, and write the page."""
    with TemporaryDirectory() as folder:
        given = walks or subject_files(data_folder(), Path(folder))
        sources = {"synthetic walk": synthetic_walk(Path(folder) / "lab"), **named(map(read_subject, given))}
        sound, outcomes = run_faults(sources, workers=workers)
        laboratories = run_sound(sound_laboratories(Path(folder), SOUND_LABORATORIES), workers)
    if details is not None:
        text = json.dumps(faults_summary(sound, outcomes, laboratories), indent=1)
        details.write_text(text + "\n", encoding="utf-8")
    page = faults_markdown(sound, outcomes, laboratories)
    if walks:
        print(page)
    else:
        write_page("faults", page)


def named(people: Iterable[SubjectFile]) -> dict[str, SubjectFile]:
    """Return people by name; several people of one name are numbered from the second on."""
    by_name: dict[str, SubjectFile] = {}
    for wanted in people:
        name = wanted.subject.name
        by_name[name if name not in by_name else f"{name} ({len(by_name) + 1})"] = wanted
    return by_name
