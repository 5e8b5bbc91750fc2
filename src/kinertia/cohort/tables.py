"""Writes the tables of a cohort: each person's rows beside the results, then all rows together.

They are Parquet files: columns with types, compressed, of which programs read only what they ask for.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from datetime import date
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from kinertia.cohort.cluster import expect_extra
from kinertia.cohort.paired import PersonChanges, means_of
from kinertia.cohort.record import AGAINST, PASSED, Place, Record
from kinertia.errors import FileError, KinertiaError, findings_of
from kinertia.estimation.changes.change import SOURCES
from kinertia.estimation.result.cycles import UNITS, columns_of
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import OVERALL
from kinertia.estimation.result.mean_cycles import gait_profile
from kinertia.estimation.simultaneous.instruments.instrument_errors import calibration_columns
from kinertia.findings.finding import Severity
from kinertia.findings.overview import Overview, finding_columns
from kinertia.io.norms_file import Norm
from kinertia.io.text.csv_file import inert, read_csv
from kinertia.io.working_folder import working_folder
from kinertia.report.comparison.change_tables import group_columns
from kinertia.report.exports.contents import summary
from kinertia.report.exports.saved_fit import load_fit
from kinertia.report.figures.cycle_figures import titled_quantities

if TYPE_CHECKING:
    import pyarrow

_SIZES = ("force_rms_N", "force_max_N", "moment_rms_Nm", "moment_max_Nm")
_STAGES = ("literature", "corrected", "estimate")
_RESIDUALS = [
    f"{kind}_{size}_{stage}" for kind in ("residual", "full_residual") for size in _SIZES for stage in _STAGES
]
_OUTCOME = ("quantity", "joint", "component", "side", "event", "unit")
_NUMBERS = ("cutoff_hz", "motion_hz", "force_cutoff_hz", "impact_force_rms_N", "mass_from_force_kg")
_COLUMNS: Mapping[str, Mapping[str, str]] = {
    "cohort": {
        **dict.fromkeys(("person", "trial", "segment", "parameter", "unit"), "string"),
        **dict.fromkeys(("literature", "estimate", "sd", "information"), "double"),
    },
    "trials": {
        **dict.fromkeys(("person", "trial"), "string"),
        **dict.fromkeys(("n_frames", "n_dynamic_frames"), "int64"),
        **dict.fromkeys(("window_start_s", "window_end_s", *_NUMBERS, "seconds"), "double"),
        **dict.fromkeys(("marker_rms_m_ik", "marker_rms_m_final", *_RESIDUALS), "double"),
        **dict.fromkeys(("verdict", "errors"), "string"),
    },
    "findings": {
        **dict.fromkeys(("person", "trial", "plate", "code", "severity", "status", "muted_by"), "string"),
        "value": "double",
        "unit": "string",
    },
    "cycles": {
        **dict.fromkeys(("person", "trial", "task", "side"), "string"),
        **dict.fromkeys(("stride", "percent"), "int64"),
        **dict.fromkeys(("quantity", "title"), "string"),
        **dict.fromkeys(("value", "sd"), "double"),
    },
    "instruments": {
        **dict.fromkeys(("person", "date", "kind", "plate", "trial", "quantity", "axis"), "string"),
        **dict.fromkeys(("value", "prior_sd", "sd"), "double"),
        "unit": "string",
        "moved": "double",
        "contradicted_by": "string",
        "with_session": "bool",
    },
    "scores": {
        **dict.fromkeys(("person", "score", "variable", "side"), "string"),
        "degrees": "double",
        "remarks": "string",
    },
    "changes": {
        "person": "string",
        **dict.fromkeys(_OUTCOME, "string"),
        **dict.fromkeys(("before", "after", "difference", "sd"), "double"),
        **dict.fromkeys((f"sd_{source}" for source in SOURCES), "double"),
        **dict.fromkeys(("sd_between_strides_before", "sd_between_strides_after"), "double"),
        "spread_assumed": "bool",
        "walks_needed": "int64",
        **dict.fromkeys(("mdc95", "p"), "double"),
        **dict.fromkeys(("strides_before", "strides_after"), "int64"),
        **dict.fromkeys(("verdict", "remarks"), "string"),
    },
    "change_means": {
        **dict.fromkeys(_OUTCOME, "string"),
        **dict.fromkeys(("people", "changed"), "int64"),
        **dict.fromkeys(("before", "after", "difference", "sd", "sd_measurement", "sd_true"), "double"),
        **dict.fromkeys(("standard_error", "lower", "upper", "p"), "double"),
    },
    "people": {
        "person": "string",
        "status": "int64",
        "verdict": "string",
        "sentence": "string",
        "overruled": "string",
        "inputs": "string",
        "kinertia": "string",
        "trials": "int64",
        "seconds": "double",
    },
}
"""Columns of every table with their types, as pyarrow names them."""
_CHANGES = ("changes", "change_means")
OF_A_PERSON = ("cohort", "trials", "findings", "cycles", "instruments")
_ROWS_AT_ONCE, _PEOPLE_AT_ONCE = 50_000, 200
"""The first to be reached ends a piece of a table. A file keeps a line on each column of each piece, which for ten
thousand people with a piece each would be more than the numbers; and small tables that wait take more memory than
their rows."""


def write_person(folder: Path, person: str, fit: Fit, day: date | None = None, with_session: bool = False) -> None:
    """Write a person's rows of the tables, into the folder of the person's results.

    Args:
        folder: folder of the person's results.
        person: name of the person.
        fit: the person's fit.
        day: day of the recording, if known.
        with_session: whether the fit used others' information on plates and synchronisation.
    """
    of_person = (
        _bsp(fit),
        _trials(fit),
        finding_columns(fit.findings),
        _cycles(fit),
        _instruments(fit, day, with_session),
    )
    for name, columns in zip(OF_A_PERSON, of_person, strict=True):
        _write_rows(folder / f"{name}.parquet", name, person, columns)


def write_findings(path: Path, person: str, error: KinertiaError) -> None:
    """Write the findings of an error that leaves a person without results."""
    _write_rows(path, "findings", person, finding_columns(findings_of(error)))


def _write_rows(path: Path, name: str, person: str, columns: Mapping[str, Any]) -> None:
    from pyarrow import parquet

    rows = len(next(iter(columns.values())))
    parquet.write_table(_table(name, {"person": [person] * rows, **columns}), path)


def write_tables(
    cohort: Path,
    records: Iterable[Record],
    with_csv: bool,
    norms: Mapping[str, Norm] = MappingProxyType({}),
    changes: Sequence[PersonChanges] = (),
) -> None:
    """Write all people's rows, in the order of the records, into the folder of the cohort; each table at once.

    Only one piece at a time is in memory, however many people there are. The list of people is always written as CSV
    too, and so are changes. Scores are against the norms; without any there are none.
    """
    from pyarrow import parquet

    with _tables_in(cohort, with_csv, ("people", *(_CHANGES if changes else ()))) as tables:
        for change in changes:
            tables["changes"].add(_table("changes", change.columns()))
        tables["change_means"].add(_table("change_means", group_columns(means_of(changes))))
        for record in records:
            tables["people"].add(_table("people", {name: [value] for name, value in asdict(record).items()}))
            if record.fitted:
                folder = Place(cohort, record.person).results
                for name in OF_A_PERSON:
                    tables[name].add(parquet.read_table(folder / f"{name}.parquet"))
                if norms:
                    tables["scores"].add(_table("scores", _scores(record.person, folder, norms)))
            elif record.inputs and (path := Place(cohort, record.person).findings).is_file():
                tables["findings"].add(parquet.read_table(path))


def fitted_people(cohort: Path) -> set[str] | None:
    """Return the people with results, by name as in the list of people; None without a list, before a first run's end.

    Raises:
        FileError: the list is no longer one written by Kinertia.
    """
    path = cohort / "people.csv"
    if not path.is_file():
        return None
    rows = read_csv(path, ["person", "status"], "the people that kinertia cohort lists")
    return {row.cells["person"] for row in rows if row.number("status") in (PASSED, AGAINST)}


def read_cohort(folder: str | Path) -> dict[str, Any]:
    """Return the tables of a cohort as lazy frames, which are read when they are computed.

    They are Dask data frames: most pandas code works on them, `compute()` returns a pandas table, and a filter reads
    only the parts of the files that it needs. DuckDB and pyarrow can read the same Parquet files. With a `Client` of a
    cluster, Dask computes there.

    Args:
        folder: folder written by `kinertia cohort`.

    Returns:
        by name: "cohort" (body segment parameters), "trials", "findings", "cycles", "instruments" (plates and
        synchronisation), "scores" (of gait, against norms), "changes" and "change_means" (between two conditions, of
        everyone and on average), and "people" (who is in the cohort, and how each fit ended).

    Raises:
        FileError: no cohort is there.
        KinertiaError: dask or pyarrow is not installed.

    Examples:
        >>> tables = kinertia.read_cohort("out")  # doctest: +SKIP
        >>> bsp = tables["cohort"]  # doctest: +SKIP
        >>> bsp[bsp.parameter == "mass"].groupby("segment")["estimate"].mean().compute()  # doctest: +SKIP
    """
    expect_extra()
    from dask import dataframe

    tables = {}
    for name in _COLUMNS:
        path = Path(folder) / f"{name}.parquet"
        if not path.is_file():
            raise FileError(path, "no such file; give a folder written by kinertia cohort")
        tables[name] = dataframe.read_parquet(path)
    return tables


def _bsp(fit: Fit) -> dict[str, Any]:
    """Return body segment parameters, with all trials that they were estimated from."""
    columns = fit.bsp_columns()
    rows = len(columns["segment"])
    known = {name: columns.get(name, [None] * rows) for name in _COLUMNS["cohort"] if name not in ("person", "trial")}
    return {"trial": [", ".join(trial.name for trial in fit.trials)] * rows, **known}


def _trials(fit: Fit) -> dict[str, Any]:
    """Return every trial's entries of `fit.json`, its verdict, and the codes of its open ERRORs."""
    rows = []
    for of_trial, trial in zip(summary(fit)["trials"], fit.trials, strict=True):
        row = {
            f"{key}_{stage}": value_of_stage
            for key, value in of_trial.items()
            if isinstance(value, dict)
            for stage, value_of_stage in value.items()
        }
        overview = Overview([finding for finding in fit.findings if finding.where.trial in (None, trial.name)], 0, 1)
        row |= {key: value for key, value in of_trial.items() if not isinstance(value, dict)}
        row |= {"trial": trial.name, "seconds": row["seconds_total"], "verdict": overview.verdict}
        row |= dict(zip(("window_start_s", "window_end_s"), of_trial["window_s"], strict=True))
        row["errors"] = " ".join(
            dict.fromkeys(finding.code for finding in overview.open if finding.severity is Severity.ERROR)
        )
        rows.append(row)
    return {name: [row[name] for row in rows] for name in _COLUMNS["trials"] if name != "person"}


def _cycles(fit: Fit) -> dict[str, Any]:
    """Return the rows of the person's `cycles.csv`, and the title of each curve in the person's figures with its
    positive direction, in which models differ.
    """
    columns = columns_of(fit.curves["estimate"])
    titles = {name: title for kind in UNITS for name, title in titled_quantities(fit.skeleton, kind)}
    return {**columns, "title": [titles.get(quantity, "") for quantity in columns["quantity"]]}


def _instruments(fit: Fit, day: date | None, with_session: bool) -> dict[str, Any]:
    """Return the person's information on plates and synchronisation; nothing by the two-level method."""
    errors = () if fit.posterior is None else fit.posterior.instrument_errors
    columns = {name: values for name, values in calibration_columns(errors).items() if name in _COLUMNS["instruments"]}
    shared = {"date": None if day is None else day.isoformat(), "with_session": with_session}
    return {**{name: [value] * len(errors) for name, value in shared.items()}, **columns}


def _scores(person: str, folder: Path, norms: Mapping[str, Norm]) -> dict[str, Any]:
    """Return a person's gait scores; one row with the reason, if there are none."""
    try:
        profile = gait_profile(load_fit(folder), norms)
    except KinertiaError as error:
        why = {"score": "GPS", "variable": OVERALL, "side": "both", "degrees": None, "remarks": str(error)}
        return {name: [cell] for name, cell in {"person": person, **why}.items()}
    columns = profile.columns()
    rows = len(columns["score"])
    return {"person": [person] * rows, **columns, "remarks": [" ".join(profile.remarks)] * rows}


def _table(name: str, columns: Mapping[str, Any]) -> pyarrow.Table:
    """Build a table with its types; unknown values and columns are null."""
    import pyarrow

    schema = pyarrow.schema(list(_COLUMNS[name].items()))
    rows = len(next(iter(columns.values())))
    return pyarrow.table(
        {
            key: pyarrow.array(columns.get(key, [None] * rows), field.type, from_pandas=True)
            for key, field in zip(schema.names, schema, strict=True)
        },
        schema,
    )


class _GrowingTable:
    """Table that is written in pieces."""

    def __init__(self, path: Path, name: str, csv_path: Path | None, open_files: ExitStack) -> None:
        from pyarrow import parquet

        self._waiting: list[pyarrow.Table] = []
        self._schema = _table(name, {key: [] for key in _COLUMNS[name]}).schema
        self._parquet = open_files.enter_context(parquet.ParquetWriter(path, self._schema))
        self._csv = None
        if csv_path is not None:
            file = open_files.enter_context(csv_path.open("w", encoding="utf-8", newline=""))
            self._csv = csv.writer(file, lineterminator="\n")
            self._csv.writerow(self._schema.names)

    def add(self, rows: pyarrow.Table) -> None:
        """Add rows; a full piece is written."""
        self._waiting.append(rows)
        rows = sum(table.num_rows for table in self._waiting)
        if rows >= _ROWS_AT_ONCE or len(self._waiting) >= _PEOPLE_AT_ONCE:
            self.write()

    def write(self) -> None:
        """Write the rows that are waiting."""
        import pyarrow

        piece = pyarrow.concat_tables([self._schema.empty_table(), *self._waiting])
        self._waiting = []
        if not piece.num_rows:
            return
        self._parquet.write_table(piece, row_group_size=piece.num_rows)
        if self._csv is not None:
            columns = [column.to_pylist() for column in piece.columns]
            self._csv.writerows([inert(cell) for cell in row] for row in zip(*columns, strict=True))


@contextmanager
def _tables_in(folder: Path, with_csv: bool, as_csv: Collection[str]) -> Iterator[dict[str, _GrowingTable]]:
    """Yield tables to add to; their files replace older ones when the block ends without an error."""
    with working_folder(folder) as work:
        with ExitStack() as open_files:
            tables = {}
            for name in _COLUMNS:
                # a CSV file of an earlier run, with other people, is not left behind
                wanted = with_csv or name in as_csv or (folder / f"{name}.csv").exists()
                csv_path = work / f"{name}.csv" if wanted else None
                tables[name] = _GrowingTable(work / f"{name}.parquet", name, csv_path, open_files)
            yield tables
            for table in tables.values():
                table.write()
        for path in [*work.glob("*.parquet"), *work.glob("*.csv")]:
            os.replace(path, folder / path.name)
