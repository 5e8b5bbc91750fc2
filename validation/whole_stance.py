"""Joint moments over whole stances against the truth."""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from validation.measured_trials import table
from validation.page import write_page

FIRST_SEED = 100
PEOPLE = 8
JOINTS, COMPONENTS = ("hip", "knee", "ankle"), ("flexion", "adduction", "rotation")
LUMBAR = tuple(f"lumbar {component}" for component in ("flexion", "bending", "rotation"))
LEG = tuple(f"{joint} {component}" for joint in JOINTS for component in COMPONENTS)
TITLES = {
    "two steps": "One right and one left step on plates",
    "one step": "One right step on a plate",
    "instruments off": "Left plate 20 mm off, forces 10 ms late, two steps",
    "knees wrong": "Knees 5 mm and 4 degrees off, two steps",
    "measured skin, two steps": "Skin as measured, two steps",
    "measured skin, one step": "Skin as measured, one step",
}
_PLACES = {
    "inside": "all contact on plates",
    "stance": "stance outside",
    "swing": "swing outside",
    "outside": "outside",
}
_HEADS = ["N m", "error", "all steps", "OpenSim", "SD / error", "covered"]


def component_row(what: str, found: Mapping[str, float]) -> list[str]:
    """Return the figures of a component."""
    return [
        what,
        *(f"{found[name]:.2f}" for name in ("error", "all_steps", "usual")),
        f"{found['sd'] / found['error']:.1f}",
        f"{100.0 * found['covered']:.0f} %",
    ]


def laboratory_section(errors: pd.DataFrame, laboratory: str) -> Iterator[str]:
    """Yield the tables of a laboratory."""
    from validation.stance_walks import pooled

    found = pooled(errors[errors["laboratory"] == laboratory])
    yield f"## {TITLES[laboratory]}"
    for place in ("inside", "stance", "swing"):
        rows = [component_row(what, found[laboratory, place, what]) for what in LEG]
        if place == "inside":
            rows += [component_row(what, found[laboratory, place, what]) for what in LUMBAR]
        yield f"Leg, {_PLACES[place]}:" if place != "inside" else "Frames in which all contact is on plates:"
        yield table(_HEADS, rows)
    if any(key[1] == "outside" for key in found):
        yield "Lumbar joint, other frames:"
        yield table(_HEADS, [component_row(what, found[laboratory, "outside", what]) for what in LUMBAR])


def document(errors: pd.DataFrame) -> str:
    """Return the text of docs/validation/whole-stance.md."""
    present = [name for name in TITLES if (errors["laboratory"] == name).any()]
    parts = [part for name in present for part in laboratory_section(errors, name)]
    skin = (
        "The recording of measured skin does not come with Kinertia: `--skin FILE` takes it."
        if any("skin" in name for name in present)
        else "Skin as measured on a person was not tested: `--skin FILE` takes a recording of it."
    )
    return TEXT.format(people=errors["seed"].nunique(), first=FIRST_SEED, skin=skin, results="\n\n".join(parts))


TEXT = """# Joint moments over whole stances

OpenSim alone made these walks (`validation/truth_trials.py`): {people} people (seeds from {first}) whose body segment
parameters differ from the model's walk the gait2354 walk, and their skin slides over the bones. The laboratory has
plates for one or two steps of four. True moments are Newton's and Euler's laws on OpenSim's motion of the true bodies
(`validation/truth_moments.py`); at the hip they equal those of OpenSim's inverse dynamics. Components are those of
`joint_moments.sto`.

*Error*: RMS error of `kinertia fit --model`. *All steps*: that of the same people where all steps are on plates, same
frames. *OpenSim*: of its inverse kinematics with coordinates low-passed at 6 Hz, the model's parameters scaled to body
mass, and the forces as measured. *SD / error*: RMS of the reported standard deviation over the error. *Covered*: share
of frames with the truth in the 95 % interval. A leg's *stance outside* is double support while the other foot is on
no plate: there the moments exist only because a joint needs no more than the loads beyond it.

Error bars allow for plates, synchronisation and knees that are not exact. Where these are exact, as in the first two
tables, bars are longer than errors, and most of all those of knee adduction: they hold 5 mm of doubt about the knee's
centre, times the body's weight. How long they should be shows where the knees are wrong: by normal deviates with
standard deviations of 5 mm sideways and 4 degrees about the thigh, each knee its own, the axes of thigh and shank with
it (`validation/wrong_knees.py`).

{skin}

{results}
"""


def gathered(seeds: Sequence[int], skin: Path | None, keep: Path | None, workers: int) -> pd.DataFrame:
    """Return `person_errors` of all people, each in a process of its own: OpenSim does not free its memory."""
    with ProcessPoolExecutor(workers, get_context("spawn"), max_tasks_per_child=1) as pool:
        return pd.concat(list(pool.map(partial(_person, skin=skin, keep=keep), seeds)), ignore_index=True)


def _person(seed: int, skin: Path | None, keep: Path | None) -> pd.DataFrame:
    from validation.stance_walks import person_errors

    kept = None if keep is None else keep / f"{seed}.pkl"
    if kept is not None and kept.exists():
        return pd.read_pickle(kept)
    result = person_errors(seed, skin)
    if kept is not None:
        result.to_pickle(kept)
    print(f"person {seed}", flush=True)
    return result


def main(
    skin: Annotated[Path | None, typer.Option(help="File of measured skin: adds its laboratories.")] = None,
    people: Annotated[int, typer.Option(help="Number of people.")] = PEOPLE,
    keep: Annotated[Path | None, typer.Option(help="Folder for results per person, which are used again.")] = None,
    workers: Annotated[int, typer.Option(help="Number of people at a time.")] = 1,
) -> None:
    """Make the page on moments of whole stances; needs OpenSim."""
    seeds = range(FIRST_SEED, FIRST_SEED + people)
    write_page("whole-stance", document(gathered(seeds, skin, keep, workers)))
