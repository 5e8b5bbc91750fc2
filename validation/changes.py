"""Count false alarms and misses of `kinertia compare`.

Compares strides of measured people in one condition, where nothing changed, and in others, where much did; and
synthetic people on three days, with and without a known change (`change_walks`, `change_people`), and what their errors
come from (`change_causes`).

With `--keep`, features of strides stay in FOLDER, and those that are there are not computed again.
"""

import pickle
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
import typer

from kinertia.estimation.changes.change import Change
from kinertia.estimation.changes.stride_features import Rows
from kinertia.studies.parallel import in_parallel
from validation.change_causes import Errors, causes_table, errors_by_source
from validation.change_people import CHANGE_DEG, Judged, Person, person
from validation.change_walks import (
    INSTRUCTED,
    SUBJECT4,
    WALKERS,
    Walker,
    alarm_shares,
    beyond,
    group,
    instructed_changes,
    judged_pairs,
    measured,
)
from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.page import write_page

FIRST_SEED = 100
_JOINTS = ("hip", "knee", "ankle", "subtalar", "lumbar", "pelvis")
_UNAFFECTED = ("ankle", "lumbar")
Kept = TypeVar("Kept")


def kept(path: Path, make: Callable[[], Kept]) -> Kept:
    """Return what was made before, or make it now; of this program only, so that pickle may be used."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pickle.dumps(make()))
        print(path.stem, flush=True)
    made: Kept = pickle.loads(path.read_bytes())
    return made


def walks_of(walker: Walker, data: Path, keep: Path) -> Rows:
    """Return the features of a measured person."""
    return kept(keep / f"{walker.title.replace(' ', '-')}.pkl", lambda: measured(walker, data, keep))


def person_of(seed_and_folder: tuple[int, Path]) -> Person:
    """Return the features of a synthetic person."""
    seed, keep = seed_and_folder
    return kept(keep / f"{seed}.pkl", lambda: person(seed))


def causes_of(seed_and_folder: tuple[int, Path]) -> list[Errors]:
    """Return the errors of a synthetic person's days, by what was put in."""
    seed, keep = seed_and_folder
    return kept(keep / f"causes-{seed}.pkl", lambda: errors_by_source(seed))


def groups() -> list[str]:
    """Return the joint groups of the page."""
    moments = [f"moment {joint}" for joint in _JOINTS if joint not in ("subtalar", "pelvis")]
    return [*moments, *(f"angle {joint}" for joint in _JOINTS)]


def share(alarms: int, count: int) -> str:
    """Return "3 of 60 (5 %)"."""
    return f"{alarms} of {count} ({100 * alarms / count:.0f} %)" if count else "-"


def alarms_table(pairs: Mapping[str, Sequence[Sequence[Change]]]) -> str:
    """Return how many differences between strides of one condition are beyond 95 %, by joint group and person."""
    shares = {title: alarm_shares(pairs_of_walker) for title, pairs_of_walker in pairs.items()}
    rows = []
    for name in groups():
        counts = [counted.get(name, (0, 0)) for counted in shares.values()]
        sums = (sum(count[k] for count in counts) for k in (0, 1))
        rows.append([name, *(share(*count) for count in counts), share(*sums)])
    return table(["joint group", *shares, "all"], rows)


def instructed_table(found: Mapping[str, Sequence[Change]]) -> str:
    """Return the knee adduction moments of normal and instructed walks."""
    rows = []
    for name, changes in found.items():
        for change in changes:
            if (change.quantity, change.joint, change.component) == ("moment", "knee", "adduction"):
                numbers = [f"{value:+.3f}" for value in (change.before, change.after, change.difference)]
                side = {"r": "right", "l": "left"}[change.side]
                beyond_95 = {True: "yes", False: "no", None: "unknown"}[beyond(change)]
                row = [name, side, change.event, *numbers, f"{change.sd:.3f}", f"{change.difference / change.sd:+.1f}"]
                rows.append([*row, beyond_95, change.verdict])
    heads = ["walk", "leg", "event", "normal", "then", "difference", "SD", "in SDs", "beyond 95 %", "verdict"]
    return table(heads, rows)


def unaffected_table(found: Mapping[str, Sequence[Change]]) -> str:
    """Return how many differences of joints that should not change are beyond 95 %."""
    rows = []
    for name, changes in found.items():
        shares = alarm_shares([changes])
        rows.append([name, *(share(*shares.get(f"moment {joint}", (0, 0))) for joint in _UNAFFECTED)])
    return table(["walk", *(f"{joint} moments" for joint in _UNAFFECTED)], rows)


def component(change: Change) -> str:
    """Return the joint group of a change and its component."""
    return f"{group(change)} {change.component}"


def components(people: Sequence[Person]) -> list[str]:
    """Return the components of the joint groups of the page."""
    known = (component(judged_change.change) for walker in people for judged_change in walker.judged(1))
    chosen = [name for name in dict.fromkeys(known) if name.rpartition(" ")[0] in groups()]
    return sorted(chosen, key=lambda name: groups().index(name.rpartition(" ")[0]))


def coverage_table(people: Sequence[Person], names: Sequence[str], name_of: Callable[[Change], str] = group) -> str:
    """Return coverage and false alarms of the synthetic people, by the joint groups or components of these names."""
    days = [[known for walker in people if (known := walker.judged(day))] for day in (1, 2)]
    rows = []
    for name in names:
        row = [name]
        for day, judged in enumerate(days):
            of_group = [
                [judged_change for judged_change in some if name_of(judged_change.change) == name] for some in judged
            ]
            covered = np.array([np.mean([judged_change.covered for judged_change in some]) for some in of_group])
            every = [judged_change for some in of_group for judged_change in some]
            of_error = np.sqrt(
                np.mean([(judged_change.change.difference - judged_change.truth) ** 2 for judged_change in every])
            )
            of_sd = np.sqrt(np.mean([judged_change.change.sd**2 for judged_change in every]))
            digits = 3 if name.startswith("moment") else 1
            standard_error = covered.std(ddof=1) / np.sqrt(len(covered)) if len(covered) > 1 else np.nan
            row.append(f"{100 * covered.mean():.0f} ± {100 * standard_error:.0f} %")
            row.append(f"{of_error:.{digits}f} / {of_sd:.{digits}f}")
            changed = sum(judged_change.change.verdict == "changed" for judged_change in every)
            if day == 0:
                row.append(share(changed, len(every)))
        rows.append(row)
    first = "joint group" if name_of is group else "component"
    return table([first, "no change: covered", "error / SD", "*changed*", "change: covered", "error / SD"], rows)


def primary_table(people: Sequence[Person]) -> str:
    """Return the primary outcomes called changed without a change, and with one."""
    rows = []
    for title, day in (("without a change", 1), ("with a change", 2)):
        primary = [
            judged_change for walker in people for judged_change in walker.judged(day) if judged_change.change.primary
        ]
        covered = sum(judged_change.covered for judged_change in primary)
        changed = sum(judged_change.change.verdict == "changed" for judged_change in primary)
        right = sum(_right(judged_change) for judged_change in primary)
        rows.append([title, share(changed, len(primary)), share(covered, len(primary)), str(right)])
    return table(["primary outcomes", "*changed*", "covered", "*changed*, and in the true direction"], rows)


def _right(judged: Judged) -> bool:
    return judged.change.verdict == "changed" and judged.change.difference * judged.truth > 0.0


def published_table(people: Sequence[Person]) -> str:
    """Return the deviations of differences between days beside published ones."""
    published = [judged_change.change for walker in people for judged_change in walker.judged(1)]

    def deviation(*wanted: str) -> str:
        some = [
            change
            for change in published
            if set(wanted) <= {change.quantity, change.joint, change.component, change.event}
        ]
        of_all = np.sqrt(np.mean([change.sd**2 for change in some]))
        smallest = np.sqrt(np.mean([change.mdc95**2 for change in some]))
        digits = 2 if "moment" in wanted else 1
        return f"{of_all:.{digits}f} ({smallest:.{digits}f})"

    knee = ("moment", "knee", "adduction")
    rows = [
        [
            "knee adduction moment, first peak (mid-stance), N m/kg",
            deviation(*knee, "mid-stance"),
            "0.11 (0.22) (1); 0.09 (0.17), osteoarthritis (4); (20 to 40 % of the moment) (5)",
        ],
        [
            "knee adduction moment, second peak (late stance), N m/kg",
            deviation(*knee, "late stance"),
            "0.14 (0.27) (1)",
        ],
    ]
    for joint, axis in (("hip", "flexion"), ("knee", "flexion"), ("ankle", "flexion"), ("hip", "rotation")):
        source = "largest of all (3)" if axis == "rotation" else "(about 5) (2)"
        rows.append([f"{joint} {axis} angle, degrees", deviation("angle", joint, axis), source])
    for joint, axis in (("hip", "flexion"), ("hip", "adduction"), ("knee", "flexion"), ("ankle", "flexion")):
        rows.append([f"{joint} {axis} moment, N m/kg", deviation("moment", joint, axis), "none found"])
    return table(["difference between days", "here: SD (smallest detectable)", "published: the same"], rows)


def document(walks: Mapping[str, Rows], people: Sequence[Person], causes: Sequence[Errors]) -> str:
    """Return the text of docs/validation/changes.md."""
    pairs = {walker.title: judged_pairs(walker, walks[walker.title]) for walker in WALKERS}
    instructed = instructed_changes(walks[SUBJECT4])
    counted = ", ".join(f"{title}: {len(judged_of_walker)}" for title, judged_of_walker in pairs.items())
    return TEXT.format(
        pairs=counted,
        alarms=alarms_table(pairs),
        instructed=instructed_table(instructed),
        unaffected=unaffected_table(instructed),
        walks=len(INSTRUCTED),
        people=len(people),
        change=", ".join(f"{name.replace('_', ' ')} {size:+.0f}" for name, size in CHANGE_DEG.items()),
        coverage=coverage_table(people, groups()) if people else "",
        by_component=coverage_table(people, components(people), component) if people else "",
        primary=primary_table(people) if people else "",
        causes=causes_table(causes, people, components(people)) if people and causes else "",
        caused=len(causes) // 2,
        published=published_table(people) if people else "",
        pairs_of_days=2 * len(people),
        alone=sum(not walker.judged(day) for walker in people for day in (1, 2)),
    )


TEXT = """# Is a change real?

`kinertia compare` against what is known: no change between strides of one condition, changes with published signs, and
synthetic people whose change is known exactly.

## Strides of one condition

All trials of a person are in one estimate. Walks are compared in pairs, strides of a run in halves and odd with even
({pairs} pairs). Nothing changed, so about 5 % should be beyond 95 %. Most pairs are single strides: `compare` says
*cannot be judged* of them. Here they are judged with the spread that is assumed with fewer than three strides. Walks of
subject4, Sydney and FMC are among those that this spread comes from, so that they are no independent test of it. It was
not measured in runs, which are judged with the spread of walks. A run of two strides has a single pair, which counts
twice: as two halves, and as odd and even strides. Dashes: not observed in any stride.

{alarms}

## Toes in, toes out, trunk sway

subject4, two normal walks against one of each kind: internal knee adduction moments, N m/kg (external ones have the
opposite sign). The verdict is *cannot be judged*, with one walk; *beyond 95 %* is with the assumed spread. Published:
toes in lower the first peak (loading, mid-stance), toes out the second (late stance, push-off), trunk sway both.

{instructed}

Joints whose moments were expected to change little, beyond 95 %, with one walk and an assumed spread. Trunk sway does
change the moments of the trunk.

{unaffected}

In the walk with trunk sway, the four ankle moments differ from those of the normal walks by 5 to 18 SDs of instruments,
body and markers together: these steps did differ. Nearly all of the deviation is the spread of strides, and one
walk does not show whether its instruction made the difference. It is 5 % slower (1.21 against 1.28 m/s), which
`compare` says first.

## Another day, markers put on anew

{people} synthetic people, each on three days, with three walks a day. Each day, markers are off by 5 mm each and by 5
mm that all of a segment share, in the static trial as well; skin moves, two thirds of it with the joints; plates and
synchronisation have errors drawn from their priors. Walks differ in posture by 0.8 to 1.6 degrees. On the second day
nothing has changed, on the third posture has (degrees: {change}). Three walks of a day are one estimate with free joint
axes; days are compared with half of the usual number of posterior draws.

*Covered*: the 95 % interval of the difference holds the true one, ± standard error over people. *Error / SD*: RMS,
N m/kg or degrees. *Changed*: called so without a change, of all outcomes, without control of the false discovery rate.

{coverage}

{primary}

By component, the same:

{by_component}

A day with a single stride on plates shows no spread: *cannot be judged*, and not counted ({alone} of {pairs_of_days}
pairs of days).

What errors of a day come from, in {caused} people with other errors: RMS, N m/kg or degrees. *Stated*: the deviation
of the difference over the square root of 2, of all people. *Shared* and *own*: placement of all markers of a segment
together, and of each marker. The error due to a source is the error of a day with that source alone, minus that of a
day without any (last column). Moments are of the true body: what the estimated body makes up for does not cancel
between days.

{causes}

True values come from the posture itself, without what differs from walk to walk, and between true contacts. Contacts
that no plate measured come from the motion; the deviations allow for 10 ms, by foot and kind of contact. Contacts that
plates measured differ from walk to walk by up to 8 ms, since posture does.

## Beside published spreads between sessions

{published}

Sources: (1) [Variability of knee adduction moment during
gait](https://discovery.researcher.life/article/variability-of-knee-adduction-moment-during-gait/94f7147599eb38a294edc9e6a4ab1da5),
ten healthy people, 0.65 and 0.79 % of body weight times height, here at a height of 1.75 m. (2) Wilken et al. 2012,
Gait Posture 35:301, 29 healthy people: changes of more than about 5 degrees can be identified between sessions. (3)
McGinley et al. 2009, Gait Posture 29:360, a review: most errors are below 5 degrees, the largest those of hip and knee
rotation. (4) Birmingham et al. 2007, Arthritis Rheum 57:1012, 31 patients with osteoarthritis of the knee, peak of the
knee adduction moment: standard error of measurement 0.36 % of body weight times height, smallest detectable 1.96 times
the square root of 2 as much. (5) [Tan et al.
2020](https://scholars.latrobe.edu.au/display/publication1037240), 32 people with healthy knees, by kind of peak,
impulse or loading rate. Published values hold the differences of one person's gait between days, which the deviations
here do not.

## What does not hold

- Lumbar moments are covered least. Their errors come from how far the trunk leans in the laboratory (correlation 0.95
  to 0.98 forwards), which is 1.4 to 1.8 degrees off between days, where 1.1 are stated. What is stated is about what
  marker placement makes. Skin motion adds as much, and is not stated: its mean over a stride is zero, and inverse
  kinematics with the static trial's model leans the trunk by 0.1 degrees wrongly (four people, skin alone), but the
  estimate, in which markers are 10 mm uncertain, turns pelvis and trunk under them, and is 0.7 degrees off. How much
  measured skin makes of it takes a person recorded on two days, which is not at hand.
- Hip rotation angles are covered in 90 % with a change. What is stated, 3 degrees of a day, is what the placement of
  each marker makes; skin and shared displacement add 1.6 and 1.2 degrees.
- On the third day knees hyperextend to 13 to 16 degrees. The estimate expects few to go beyond 10 (SD 5), from which
  joints count as hypermobile, and pulls them back: angles are too flexed by 0.8 degrees in all of the stride. (In
  mid-stance of three people it was 1.0 degrees, without the limits 0.4.) A person with such knees states `ranges_deg`;
  these people do not.
- Intervals of ankle, subtalar and pelvis angles are longer than the errors are. Nearly all of them is marker
  placement. Errors are 5 mm of each marker, which rotate a segment, and 5 mm of all of its markers, which do not; the
  estimate takes 10 mm of each, which rotate it more.
- Ankles are 5 mm less certain to the side than in the estimate, as knees are: displaced malleoli move the ankle's
  centre in shank and foot alike, where the estimate takes markers of both for independent. Without these 5 mm,
  adduction moments of ankles were covered in 92 and 90 %, with a deviation of 0.085 N m/kg.
- The spread of strides is pooled over the components of a joint, whose moments differ in size: rotation moments of
  hips, knees and ankles, the smallest, are covered in 99 to 100 %. Pooled by component, with the bars of an earlier
  version, they were covered in 92 to 96 %, but lumbar moments in 92 and 90 %, since their long intervals of rotation
  make up for short ones of flexion.
- Three markers show the pelvis, and one of them 6 mm off tilts it by 2 degrees. Marker places are therefore taken as
  10 mm uncertain between days: with 7 mm, hip angles of two people were covered in 67 %, with 10 mm in 87 %.
- Forty people are the default; the table says how many were run, and its standard errors count them.
- What errors come from was computed at commit b7593c1b, before motion at the ends of recordings was mended.
- Where joint axes are fixed in the fits, `compare` multiplies deviations by 1.6. Axes are free here, so that this
  factor is not tested.
- One walk of each kind, runs of two strides and people with two or three walks cannot show a rate between 3 and 8 %,
  nor judge the spread of three and more repeats, which is what `compare` needs.
- Toes in raised the second peak of the knee adduction moment and did not lower the first beyond 95 %; one walk.
"""


def main(
    people: Annotated[int, typer.Option(min=0, help="Synthetic people, from seed 100.")] = 40,
    causes: Annotated[int, typer.Option(min=0, help="Synthetic people whose errors are split by cause.")] = 8,
    keep: Annotated[Path | None, typer.Option(help="Folder for features, used again.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes (default: all cores).")] = None,
) -> None:
    """Run everything and write the page."""
    with tempfile.TemporaryDirectory() as folder:
        work = (keep or Path(folder)).resolve()
        walks = {walker.title: walks_of(walker, data_folder(), work) for walker in WALKERS}
        seeds = [(seed, work) for seed in range(FIRST_SEED, FIRST_SEED + people)]
        found = in_parallel(person_of, seeds, workers) if seeds else []
        split = in_parallel(causes_of, seeds[:causes], workers) if seeds[:causes] else []
        write_page("changes", document(walks, found, [errors for days in split for errors in days]))
