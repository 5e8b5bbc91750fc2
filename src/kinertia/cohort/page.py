"""Writes `cohort.html`: verdicts and findings of a cohort, changes, outliers, and mean curves.

Made from the cohort's tables: for ten thousand people, curves are summed in pieces and names are stored once.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np
from markupsafe import Markup, escape

from kinertia.cohort.instruments import COLUMNS, drift
from kinertia.cohort.record import AGAINST
from kinertia.diagnostics.limits import with_limits
from kinertia.estimation.result.cycles import UNITS, Kind
from kinertia.findings.display import outlined, shown
from kinertia.findings.finding import Severity
from kinertia.findings.overview import USES
from kinertia.findings.quantity import Quantity
from kinertia.findings.rule import matching, rule
from kinertia.io.output_folder import write_then_rename
from kinertia.model.bsp import PARAMETERS
from kinertia.motion.gait_cycle import PERCENT
from kinertia.report.figures.bsp_figures import NAMES, segment_name
from kinertia.report.figures.cycle_figures import band, mean_line
from kinertia.report.figures.figure import BLUE, SIDES, Figure, Panel, bar_figure, dot_figure, faded, small_multiples
from kinertia.report.pages.finding_view import linked
from kinertia.report.pages.rendering import Part, render_parts

if TYPE_CHECKING:
    import pandas as pd


PAGE = "cohort.html"
_QUANTILES = {"5 % of people below": 0.05, "median": 0.5, "95 % below": 0.95}
_SHOWN = {"mass": ("mass (kg)", 1.0), "com_x": ("CoM forward (mm)", 1e3), "com_y": ("CoM upward (mm)", 1e3)}
_KINDS: tuple[Kind, ...] = ("angle", "moment")
_JOINTS = ("hip_flexion", "knee_angle", "ankle_angle")
_CURVES = {f"{name}_{kind}": UNITS[kind] for kind in _KINDS for name in _JOINTS}
"""Curves that are shown, and their units."""
_NORMAL = 1.4826
"""Standard deviation over median distance from the median, of normal values."""
_MOST_OUTLIERS, _FAR = 20, 6.0
_MOST_SCORES = 50
_SCORE_HEADINGS = ("person", "overall", "right", "left", "farthest variable", "remarks")
_SIZES = {"force (N)": "force_rms_N", "moment (N m)": "moment_rms_Nm"}
PEOPLE = ("person", "status", "sentence", "verdict", "overruled")
FINDINGS = ("person", "code", "severity", "status", "muted_by", "value", "unit")
"""Columns that are read of the two tables."""
NOT_FITTED = "not fitted"
_MOST_NAMES, _MOST_PEOPLE = 5, 20
_HEADINGS = ("code", "severity", "finding", "people", "open", "explained by another", "overruled", "median size", "who")


def write_cohort_page(folder: Path, of_changes: Iterable[Part] = ()) -> None:
    """Write the page beside the tables that `write_tables` has written into the folder; changes come first."""
    people = _read(folder, "people", PEOPLE)
    parts = [*of_changes, *outcome_parts(people, _read(folder, "findings", FINDINGS))]
    if (people["status"] <= AGAINST).any():
        bsp = _read(folder, "cohort", ("person", "segment", "parameter", "literature", "estimate", "sd"))
        parts += [*_changes(bsp), _residuals(folder), _outliers(bsp), *score_parts(folder), *_mean_curves(folder)]
        parts += drift(_read(folder, "instruments", COLUMNS))
    write_then_rename(folder / PAGE, render_parts("Cohort", lead(people), parts))


def _read(folder: Path, table: str, columns: Sequence[str]) -> pd.DataFrame:
    """Read these columns; repeated names are in memory only once."""
    from pyarrow import parquet

    repeated = [name for name in ("person", "segment", "parameter") if name in columns]
    read = parquet.read_table(folder / f"{table}.parquet", columns=list(columns), read_dictionary=repeated)
    frame: pd.DataFrame = read.to_pandas()
    return frame


def _changes(bsp: pd.DataFrame) -> Iterator[Part]:
    """Draw the estimate minus literature, segment by segment, across people."""
    change = bsp["estimate"] - bsp["literature"]
    segments = list(dict.fromkeys(bsp["segment"]))
    panels: dict[str, Mapping[str, Sequence[float]]] = {}
    for parameter, (title, factor) in _SHOWN.items():
        chosen = bsp["parameter"] == parameter
        grouped = (factor * change[chosen]).groupby(bsp["segment"][chosen], observed=True)
        panels[title] = {word: grouped.quantile(share)[segments].tolist() for word, share in _QUANTILES.items()}
    figure = dot_figure(
        [segment_name(segment) for segment in segments],
        panels,
        "Change made by the estimate, by segment, across people.",
    )
    caption = "Estimate minus literature. Every number: cohort.parquet (kinertia cohort --csv: cohort.csv)."
    yield Part("What the estimates changed", figure=figure, caption=caption)


def _residuals(folder: Path) -> Part:
    """Draw the residuals of all trials before and after."""
    stages = {"literature": "before", "corrected": "pelvis corrected", "estimate": "estimate"}
    columns = [f"residual_{size}_{stage}" for size in _SIZES.values() for stage in stages]
    trials = _read(folder, "trials", columns)
    panels = {
        title: {
            word: [float(trials[f"residual_{size}_{stage}"].quantile(share)) for stage in stages]
            for word, share in _QUANTILES.items()
        }
        for title, size in _SIZES.items()
    }
    figure = dot_figure(list(stages.values()), panels, "Root residuals of all trials, before and after the estimate.")
    return Part("Residuals", (f"{len(trials)} trials, RMS of each.",), figure)


def _outliers(bsp: pd.DataFrame) -> Part:
    """List people with a parameter far from the others', in the others' spread or, where larger, in error bars: a few
    people may be close together by chance. Each is linked to the report.
    """
    parameter = [bsp["segment"], bsp["parameter"]]
    change = bsp["estimate"] - bsp["literature"]
    away = (change - change.groupby(parameter, observed=True).transform("median")).abs()
    spread = _NORMAL * away.groupby(parameter, observed=True).transform("median")
    unit = spread.where(~(spread < bsp["sd"]), bsp["sd"])
    score = (away / unit.where(unit > 0)).fillna(0.0)
    worst = bsp.loc[score.groupby(bsp["person"], observed=True).idxmax(), ["person", "segment", "parameter"]]
    rows = zip(score[worst.index], *(worst[name].astype(str) for name in worst), strict=True)
    far = sorted((row for row in rows if row[0] > _FAR), reverse=True)
    listed = [
        report_of(person)
        + f": {NAMES[PARAMETERS.index(name)]} of {segment_name(segment)}, {value:.1f} spreads from the others"
        for value, person, segment, name in far[:_MOST_OUTLIERS]
    ]
    text = "People in whom a parameter changed by over six spreads (by the median, or error bars) more than the median."
    return Part("Far from the others", (text if listed else f"Nobody: {text[0].lower()}{text[1:]}",), listed=listed)


def score_parts(folder: Path) -> Iterator[Part]:
    """Return a table of Gait Profile Scores (degrees), the largest first; nothing without norms."""
    from pyarrow import parquet

    scores: pd.DataFrame = parquet.read_table(folder / "scores.parquet").to_pandas()
    if not len(scores):
        return
    rows = sorted(
        (_score_row(str(person), of_person) for person, of_person in scores.groupby("person")), key=lambda row: -row[0]
    )
    known = [score for score, _ in rows if score >= 0]
    text = "Gait Profile Score (Baker 2009) against the norms, degrees, the largest first."
    if known:
        text += f" Median {np.median(known):.1f}, from {min(known):.1f} to {max(known):.1f}, of {len(known)} people."
    more = f" {len(rows) - _MOST_SCORES} more people are in scores.parquet." if len(rows) > _MOST_SCORES else ""
    yield Part(
        "Gait Profile Score", (text + more,), headings=_SCORE_HEADINGS, rows=[cells for _, cells in rows[:_MOST_SCORES]]
    )


def _score_row(person: str, scores: pd.DataFrame) -> tuple[float, tuple[str, ...]]:
    """Return the overall score, -1 where there is none, and the cells."""
    gps = scores[scores["score"] == "GPS"].set_index("side")["degrees"]
    variables = scores[scores["score"] == "GVS"].dropna(subset=["degrees"])
    farthest = ""
    if len(variables):
        worst = variables.iloc[int(variables["degrees"].argmax())]
        farthest = f"{worst['variable']}, {SIDES[worst['side']][0]}: {worst['degrees']:.1f}"
    overall = float(gps.get("both", np.nan))
    cells = (*(_degrees(float(gps.get(side, np.nan))) for side in ("both", "r", "l")), farthest)
    return overall if np.isfinite(overall) else -1.0, (report_of(person), *cells, str(scores["remarks"].iloc[0]))


def _degrees(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else ""


def _mean_curves(folder: Path) -> Iterator[Part]:
    """Draw mean and spread of all strides over the gait cycle, both sides, summed up piece by piece; separately of each
    task, and where models differ in the positive direction.
    """
    from pyarrow import dataset

    sums: defaultdict[tuple[str, str, str], np.ndarray] = defaultdict(lambda: np.zeros((len(PERCENT), 3)))
    source = dataset.dataset(folder / "cycles.parquet")
    wanted = dataset.field("quantity").isin(list(_CURVES))
    for batch in source.to_batches(columns=["task", "quantity", "title", "percent", "value"], filter=wanted):
        frame = batch.to_pandas().dropna()
        for curve, part in frame.groupby(["task", "quantity", "title"]):
            at, value = part["percent"].to_numpy(), part["value"].to_numpy()
            np.add.at(sums[curve], at, np.column_stack([np.ones_like(value), value, value**2]))
    if sums:
        text = "Over the gait cycle (%): mean and SD of all strides of all people, both sides"
        apart = "; tasks, and models of opposite sign conventions, have separate panels"
        caption = f"{text}{apart if len(sums) > len({quantity for _, quantity, _ in sums}) else ''}."
        order = list(_CURVES)
        shown = sorted(sums, key=lambda curve: (curve[0] != "walk", curve[0], order.index(curve[1]), curve[2]))
        yield Part("Mean curves", figure=_curves({curve: sums[curve] for curve in shown}), caption=caption)


def _curves(sums: Mapping[tuple[str, str, str], np.ndarray]) -> Figure:
    """Draw mean and spread by task, quantity and title."""
    panels, several = [], len({task for task, *_ in sums}) > 1
    for (task, quantity, title), every in sums.items():
        total = np.where(every[:, :1] > 0, every, np.nan)  # gaps where nobody was measured
        mean = total[:, 1] / total[:, 0]
        sd = np.sqrt(np.maximum(total[:, 2] / total[:, 0] - mean**2, 0.0))
        spread = {**band(mean - sd, mean + sd, faded(BLUE, 0.2)), "name": "mean ± SD"}
        line = {**mean_line(mean), "name": "mean", "line": {"color": BLUE}}
        named = f"{task}: {title}" if several and task else title
        panels.append(Panel(f"{named} ({_CURVES[quantity]})", [spread, line]))
    return small_multiples(panels, "Mean curves over the gait cycle.", {"range": [0, 100]})


def lead(people: pd.DataFrame) -> str:
    """Write the page's first sentence."""
    counts = _counts(people)
    said = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    return f"{len(people)} people: {said}. Each one's report is in people/NAME/report.html."


def _counts(people: pd.DataFrame) -> dict[str, int]:
    counted = Counter(people["verdict"])
    return {word: counted[word] for word in USES} | {NOT_FITTED: counted[""]}


def outcome_parts(people: pd.DataFrame, findings: pd.DataFrame) -> Iterator[Part]:
    """Yield verdicts, people without results and why, findings by code, unused overrules, and the meaning of codes."""
    counts = _counts(people)
    bars = bar_figure(
        ["people"],
        {f"{word} ({count})": [count] for word, count in counts.items()},
        ", ".join(f"{count} {word}" for word, count in counts.items()),
        "people",
    )
    without = people[people["verdict"] == ""]
    why = [
        Markup("{}: {}").format(*row) for row in zip(without["person"], map(linked, without["sentence"]), strict=True)
    ]
    more = (f"{len(why)} people; the others are in people.csv.",) if len(why) > _MOST_PEOPLE else ()
    yield Part("Verdicts", figure=bars)
    if why:
        yield Part("Not fitted", more, listed=why[:_MOST_PEOPLE])
    if len(findings):
        fitted = set(people["person"][people["verdict"] != ""])
        text = "Every finding: findings.parquet. Open: neither explained by another finding nor overruled."
        yield Part("Findings by code", (text,), headings=_HEADINGS, rows=_by_code(findings, fitted))
    if vain := overruled_in_vain(people, findings):
        yield Part("Overruled, but never found", listed=vain)
    if len(findings):
        yield Part("What the codes mean", listed=[_meaning(code) for code in sorted(findings["code"].unique())])


def _by_code(findings: pd.DataFrame, fitted: set[str]) -> list[tuple[str, ...]]:
    """Return a row for each code, the worst and most frequent first."""
    rows = []
    for code, of_code in findings.groupby("code", observed=True):
        severity = max(Severity[name] for name in of_code["severity"].unique())
        muted = of_code["muted_by"].notna() & (of_code["status"] == "open")
        overruled, people = of_code["status"] != "open", of_code["person"].unique().tolist()
        counts = [
            len(people),
            len(of_code) - int(overruled.sum()) - int(muted.sum()),
            int(muted.sum()),
            int(overruled.sum()),
        ]
        names = Markup(", ").join(report_of(name) if name in fitted else escape(name) for name in people[:_MOST_NAMES])
        cells = (linked(str(code)), severity.name, rule(str(code)).name.replace("-", " "), *map(str, counts))
        more = names + (", ..." if len(people) > _MOST_NAMES else "")
        rows.append(((-severity, -len(people), str(code)), (*cells, _median(of_code), more)))
    return [cells for _, cells in sorted(rows, key=lambda row: row[0])]


def _median(findings: pd.DataFrame) -> str:
    """Return the median size of the headlines; empty where there is none."""
    known = findings.dropna(subset=["value"])
    if not len(known):
        return ""
    return shown(Quantity(float(np.median(known["value"].abs())), str(known["unit"].iloc[0])))


def overruled_in_vain(people: pd.DataFrame, findings: pd.DataFrame) -> list[str]:
    """List codes, questions or families that people waive or ignore, and that were never found."""
    said = Counter(code for text in people["overruled"] for code in text.split())
    found = set(findings["code"].unique())
    return [f"{code}: {count} people" for code, count in said.most_common() if not found & set(matching(code))]


def _meaning(code: str) -> Markup:
    explained = with_limits(rule(code))
    texts = (
        code,
        code,
        explained.name.replace("-", " "),
        explained.detects,
        outlined(explained.effect),
        outlined(explained.remedy),
    )
    return Markup('<strong id="explain-{}">{} {}</strong>: {} {} {}').format(*texts)


def report_of(person: str) -> Markup:
    """Return the name as a link to the person's report."""
    return Markup('<a href="people/{}/report.html">{}</a>').format(quote(person), person)
