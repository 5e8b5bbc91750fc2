"""Small results of every study, of `plan`, `crossval` and a cohort, for tests of their pages and tables."""

from dataclasses import astuple, replace
from pathlib import Path

import numpy as np

from found import FAULT_FREE, FAULTY, UNUSABLE
from kinertia.cohort.record import Place, Record
from kinertia.cohort.tables import write_findings, write_person, write_tables
from kinertia.errors import BlockedError
from kinertia.estimation.result.fit import Fit
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Where
from kinertia.io.versions import VERSION
from kinertia.model.bsp import PARAMETERS
from kinertia.studies.cross_validation import Explained, HeldOut
from kinertia.studies.plan import Plan
from kinertia.studies.sensitivity import CONDITIONS as NOISES
from kinertia.studies.sensitivity import Sensitivity
from kinertia.studies.table1 import CONDITIONS, PUBLISHED, Draw, Errors, Table1
from kinertia.studies.table1_variants import LONG, LONG_GROUND, NOISY

PRIOR = np.ones((2, len(PARAMETERS)))
PLAN = Plan(
    ("shank_r", "<b>"), PRIOR, {("walk",): 0.4 * PRIOR, ("<i>squat",): 0.9 * PRIOR, ("walk", "<i>squat"): 0.2 * PRIOR}
)
HELD_OUT = (
    HeldOut("one", ("two",), Explained(200.0, 10.0, 4.0, 0.010), Explained(150.0, 8.0, 3.0, 0.009)),
    HeldOut("two", ("one",), Explained(100.0, 9.0, 3.5, 0.008), Explained(120.0, 9.5, 3.6, 0.008)),
)


def sensitivity() -> Sensitivity:
    """Three parameters: one always seen, one lost in noise, one never seen."""
    errors = {key: np.array([0.2, 0.3, 0.99]) for key in NOISES}
    errors["study x 2"] = np.array([0.3, 0.7, 1.0])
    return Sensitivity(("torso.com_z", "thigh.mass", "pelvis.iyy"), errors, 2, 1)


def table1() -> Table1:
    """Two draws: twice and four times the published errors."""
    segments = ("pelvis", "torso", "thigh", "shank", "foot", "upper_arm", "forearm")
    shown = ("mass", "com_x", "com_y", "com_z", "ixx", "iyy", "izz")
    draws = tuple(
        Draw(
            number=k,
            errors={c: Errors(*(factor * np.array(astuple(PUBLISHED[c]))).tolist()) for c in CONDITIONS},
            parameter_errors={c: np.outer([0.1, 0.01 * factor], np.ones(49)) for c in CONDITIONS},
            costs={c: np.array([2.0, 1.0]) for c in CONDITIONS},
            converged=dict.fromkeys(CONDITIONS, True),
        )
        for k, factor in enumerate((2.0, 4.0))
    )
    parameters = tuple(f"{segment}.{parameter}" for segment in segments for parameter in shown)
    return Table1(parameters, np.ones(49), draws, 3, "walk <1>")


def variants() -> dict[str, Table1]:
    """Two variants of two draws: twice and four times the published errors, of which the first has all conditions."""

    def draw(number, factor, conditions):
        errors = {c: Errors(*(factor * np.array(astuple(PUBLISHED[c]))).tolist()) for c in conditions}
        paths = {c: np.full((4, 49), 0.1) for c in conditions}
        costs = {c: np.array([8.0, 4.0, 3.0, 2.99999]) for c in conditions}
        return Draw(number, errors, paths, costs, dict.fromkeys(conditions, True))

    draws = (draw(0, 2.0, CONDITIONS), draw(1, 4.0, NOISY))
    return {title: Table1(("a",) * 49, np.ones(49), draws, 1, title) for title in (LONG, LONG_GROUND)}


def person_record(name: str, status: int = 0, sentence: str = "", verdict: str = "", overruled: str = "") -> Record:
    """How one person of a cohort ended."""
    return Record(name, status, sentence, "9f", VERSION, 1, 1.0, verdict, overruled)


def write_cohort(fit: Fit, folder: Path) -> None:
    """Eight people alike but for small differences, of whom one has a heavy thigh; two without results.

    Ben's result is not to be used, that of Zoë with care, and Anna ignores a code of which nothing is found.
    """
    records = []
    for k, name in enumerate(["Anna", "Ben", "Zoë &", "D", "E", "F", "G", "H"]):
        table = fit.estimate.table() * (1.0 + 0.001 * k)
        if name == "Zoë &":
            table[2, 0] += 5.0
        found = {1: UNUSABLE, 2: FAULTY}.get(k, FAULT_FREE)
        estimate = type(fit.estimate).from_table(fit.estimate.segments, table)
        person = replace(fit, estimate=estimate, findings=found)
        Place(folder, name).results.mkdir(parents=True)
        write_person(Place(folder, name).results, name, person)
        overruled = "" if k else "R40 T301"
        records.append(person_record(name, int(k == 1), "", person.overview.verdict, overruled))
    (folder / "failed").mkdir()
    for k in range(2):
        no_forces = [finding("P271", Where(trial=f"w{k}"))]
        error = BlockedError(no_forces, no_forces)
        write_findings(Place(folder, f"lost{k}").findings, f"lost{k}", error)
        records.append(person_record(f"lost{k}", 2, str(error)))
    write_tables(folder, records, with_csv=False)
