"""Ask what a wrong prior costs children and others."""

from collections.abc import Sequence
from typing import Annotated

import typer

from validation.page import write_part
from validation.population_study import (
    INFORMED_SD,
    RUCKSACK_KG,
    MeanAccuracy,
    PopulationAccuracy,
    PopulationsStudy,
    RucksackAccuracy,
    run_populations,
)

HEADINGS = ("population", "prior", "mass (kg)", "CoM (mm)", "inertia (kg m2)", "moments (N m)", "coverage", "unlike")
CAPTION = (
    "RMS errors, after the estimate / of what it started from. moments: what wrong parameters make of joint moments, "
    "with the true motion and forces. coverage: parameters within their 95 % intervals. unlike: people of whom the fit "
    "says that they are unlike the prior. exactly known: the distribution from which the people were drawn, the best "
    "that any prior can do."
)
_SHOWN = {"mass": (1.0, ".2f"), "CoM": (1e3, ".1f"), "inertia": (1.0, ".3f")}
"""Factor to the unit of the heading, and digits."""


def population_rows(accuracies: Sequence[PopulationAccuracy]) -> list[list[str]]:
    """Return one row per population and prior, under `HEADINGS`."""
    rows = []
    for accuracy in accuracies:
        cells = [
            _both(factor * accuracy.rms[name], factor * accuracy.rms_before[name], form)
            for name, (factor, form) in _SHOWN.items()
        ]
        cells.append(_both(accuracy.moments_nm, accuracy.moments_before_nm, ".2f"))
        rows.append(
            [
                accuracy.title,
                accuracy.prior,
                *cells,
                f"{100 * accuracy.coverage:.1f} %",
                f"{100 * accuracy.unlike:.0f} %",
            ]
        )
    return rows


def mean_sentences(means: Sequence[MeanAccuracy]) -> list[str]:
    """Describe what is learnt of the mean of each population, in a sentence each."""
    return [
        f"Mean of {mean.people} {mean.title}: {mean.informed} parameters are known to {INFORMED_SD:g} of "
        f"the literature's deviations or better; of these {100 * mean.coverage:.0f} % are within their 95 % intervals "
        f"(of all {100 * mean.coverage_of_all:.0f} %), and the tables' RMS error of {mean.rms_before:.2f} "
        f"deviations becomes {mean.rms:.2f}."
        for mean in means
    ]


def rucksack_sentence(rucksacks: Sequence[RucksackAccuracy]) -> str:
    """Describe the estimate of a rucksack that was declared with unknown mass."""
    found = [
        f"{_gain(rucksack)}: RMS error {rucksack.rms_kg:.2f} kg, stated deviation {rucksack.sd_kg:.2f} kg, within the "
        f"95 % interval in {100 * rucksack.coverage:.0f} %"
        for rucksack in rucksacks
    ]
    return (
        f"A rucksack of {RUCKSACK_KG:g} kg, declared with unknown mass, {rucksacks[0].people} people. "
        f"{'; '.join(found)}."
    )


def _gain(rucksack: RucksackAccuracy) -> str:
    if rucksack.gain_sd_percent is None:
        return "Nothing stated of the plates, one in twenty with a faulty gain"
    return f"with gain_sd_percent = {rucksack.gain_sd_percent:g}"


def _both(after: float, before: float, form: str) -> str:
    return f"{after:{form}} / {before:{form}}"


def populations_markdown(study: PopulationsStudy) -> str:
    """Return the table, its caption, what is learnt of means, and the sentence on the rucksack."""
    lines = [HEADINGS, ("---",) * 2 + ("--:",) * (len(HEADINGS) - 2), *population_rows(study.accuracies)]
    table = "\n".join("| " + " | ".join(cells) + " |" for cells in lines)
    people = f"{study.accuracies[0].people} people each. {CAPTION}"
    texts = (table, people, "\n".join(mean_sentences(study.means)), rucksack_sentence(study.rucksacks))
    return "\n\n".join(text for text in texts if text) + "\n"


def main(
    people: Annotated[int, typer.Option(min=2, help="People of each population.")] = 24,
    seed: Annotated[int, typer.Option(help="Of people and noise.")] = 1,
    workers: Annotated[int | None, typer.Option(help="Processes (default: one per core).")] = None,
) -> None:
    """Simulate and estimate everybody, and write the tables into the page."""
    write_part("populations", populations_markdown(run_populations(people, seed, workers)))
