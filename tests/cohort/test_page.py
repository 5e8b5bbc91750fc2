"""The page of a cohort: outcomes and reasons counted, people far from the others linked, mean curves."""

import json
import re
from dataclasses import asdict

import numpy as np
import pandas as pd
import pytest

from kinertia.cohort.instruments import drift
from kinertia.cohort.page import (
    PAGE,
    _curves,
    _mean_curves,
    _outliers,
    lead,
    outcome_parts,
    overruled_in_vain,
    write_cohort_page,
)
from kinertia.cohort.tables import write_tables
from report_page import figures_of
from study_results import person_record, write_cohort


@pytest.fixture
def cohort(fit, tmp_path):
    write_cohort(fit, tmp_path)
    return tmp_path


@pytest.mark.slow
def test_the_page_says_who_passed_and_who_is_far(cohort):
    write_cohort_page(cohort)
    page = (cohort / PAGE).read_text(encoding="utf-8")
    assert "10 people: 6 use, 1 use with care, 1 do not use, 2 not fitted." in page
    text = re.sub(r"<[^>]+>", " ", page)
    assert re.search(r"lost0: w0 P271", " ".join(text.split()))
    assert re.search(r"P271\s+ERROR\s+no forces\s+2\s+2\s+0\s+0\s+lost0 *, *lost1", " ".join(text.split()))
    assert re.search(r"P244\s+ERROR\s+cop not under feet\s+2\s+0\s+0\s+2\s+62 mm\s+Ben", " ".join(text.split()))
    assert "T301: 1 people" in text
    assert "R40: 1 people" in text
    links = re.findall(r'<a href="(people/[^"]+)">([^<]+)</a>: ([^<]+)', page)
    assert [link[:2] for link in links] == [("people/Zo%C3%AB%20%26/report.html", "Zoë &amp;")]
    assert links[0][2].startswith("mass of thigh, right, ")
    assert "Knee moment, flexion + (N m/kg)" in json.dumps(figures_of(page))


def found(person, code, severity="WARNING", status="open", muted_by=None, value=None, unit=None):
    """A row of the table of findings."""
    columns = {"severity": severity, "status": status, "muted_by": muted_by, "value": value, "unit": unit}
    return {"person": person, "code": code, **columns}


@pytest.fixture
def people():
    """Anna's result may be used, that of Ben & Co with care, Eve's not; nobody could fit the last."""
    records = [
        person_record("Anna", verdict="use", overruled="M102 P21"),
        person_record("Ben & Co", verdict="use with care", overruled="P244"),
        person_record("Eve", 1, "R301", "do not use"),
        person_record("lost", 2, "P278 no window", overruled="P244"),
    ]
    return pd.DataFrame([asdict(record) for record in records])


FINDINGS = pd.DataFrame(
    [
        found("Ben & Co", "P213", value=-20.0, unit="N"),
        found("Ben & Co", "P213", value=30.0, unit="N"),
        found("Ben & Co", "P214", muted_by="P213"),
        found("Eve", "P213", value=26.0, unit="N", status="ignored"),
        found("Eve", "R301", "ERROR", value=12.0, unit="N"),
        found("lost", "P278", "ERROR"),
    ]
)


def test_people_are_counted_by_verdict(people):
    assert lead(people).startswith("4 people: 1 use, 1 use with care, 1 do not use, 1 not fitted.")
    verdicts, not_fitted, *_ = outcome_parts(people, FINDINGS)
    assert [trace["name"] for trace in verdicts.figure.data] == [
        "use (1)", "use with care (1)", "do not use (1)", "not fitted (1)",
    ]  # fmt: skip
    assert not_fitted.listed == ['lost: <a class="code" href="#explain-P278">P278</a> no window']


def test_findings_are_counted_by_code_the_worst_first(people):
    by_code = next(part for part in outcome_parts(people, FINDINGS) if "open" in part.headings)
    rows = [tuple(re.sub("<[^>]+>", "", cell) for cell in row) for row in by_code.rows]
    assert [(row[0], row[1], *row[3:8]) for row in rows] == [
        ("P278", "ERROR", "1", "1", "0", "0", ""),
        ("R301", "ERROR", "1", "1", "0", "0", "12 N"),
        ("P213", "WARNING", "2", "2", "0", "1", "26 N"),
        ("P214", "WARNING", "1", "0", "1", "0", ""),
    ]
    assert by_code.rows[3][-1] == '<a href="people/Ben%20%26%20Co/report.html">Ben &amp; Co</a>'
    assert by_code.rows[0][-1] == "lost", "who has no report is not linked"


def test_codes_that_are_overruled_in_vain_are_listed(people):
    """P21 stands for P213, which was found."""
    assert overruled_in_vain(people, FINDINGS) == ["P244: 2 people", "M102: 1 people"]


def rows_of(changes, sd):
    """A table of one parameter: change and error bar per person."""
    columns = {"segment": "thigh_r", "parameter": "mass", "literature": 8.0, "sd": sd}
    return pd.DataFrame([{"person": f"p{k}", "estimate": 8.0 + change, **columns} for k, change in enumerate(changes)])


def test_few_people_who_are_close_together_by_chance_make_no_outlier():
    changes = [0.0, 0.001, -0.001, 0.002, 0.3]
    assert not _outliers(rows_of(changes, 0.5)).listed, "less than its error bar"
    assert len(_outliers(rows_of(changes, 0.01)).listed) == 1
    assert len(_outliers(rows_of(changes, np.nan)).listed) == 1, "two-level has no error bars"


def test_where_nobody_was_measured_mean_curves_have_a_gap():
    every = np.tile([2.0, 4.0, 8.5], (101, 1))
    every[40:60] = 0.0
    spread, line = _curves({("walk", "knee_angle_moment", "Knee moment, flexion +"): every}).data
    assert np.isnan(np.asarray(line["y"], dtype=float)[40:60]).all()
    assert np.asarray(line["y"])[:40] == pytest.approx(2.0)
    assert not set(range(40, 60)) & set(np.asarray(spread["x"])[np.isfinite(spread["y"])].tolist())


def test_knees_of_models_with_opposite_signs_are_not_averaged(tmp_path):
    """One model's knee angle is flexion and another's extension: mean 0."""
    titles = {"Anna": ("Knee flexion +", 1.0), "Ben": ("Knee extension +", -1.0)}
    rows = pd.concat(
        pd.DataFrame({
            "task": "walk", "quantity": "knee_angle_angle", "title": title,
            "percent": np.arange(101), "value": 30.0 * sign,
        })
        for title, sign in titles.values()
    )  # fmt: skip
    rows.to_parquet(tmp_path / "cycles.parquet")
    (part,) = _mean_curves(tmp_path)
    means = [trace["y"][0] for trace in part.figure.data if trace["name"] == "mean"]
    assert sorted(means) == [-30.0, 30.0]
    assert "separate panels" in part.caption


def test_walks_and_turns_of_a_cohort_are_not_averaged(tmp_path):
    shown = {"quantity": "knee_angle_moment", "title": "Knee moment, flexion +", "percent": np.arange(101)}
    tasks = {"turn": 2.0, "walk": 1.0}
    rows = pd.concat(pd.DataFrame({"task": task, **shown, "value": value}) for task, value in tasks.items())
    rows.to_parquet(tmp_path / "cycles.parquet")
    (part,) = _mean_curves(tmp_path)
    means = [trace["y"][0] for trace in part.figure.data if trace["name"] == "mean"]
    assert means == [1.0, 2.0]
    assert "separate panels" in part.caption


@pytest.mark.slow
def test_a_cohort_of_whom_nobody_was_fitted_has_a_page(tmp_path):
    write_tables(tmp_path, [person_record("lost", 2, "no force plates")], with_csv=False)
    write_cohort_page(tmp_path)
    assert "1 people: 1 not fitted." in (tmp_path / PAGE).read_text(encoding="utf-8")


def instrument(person, day, value, sd, prior_sd=0.01, with_session=False):
    columns = {"kind": "plate", "plate": "plate 1", "trial": None, "quantity": "gain", "axis": None, "unit": "1"}
    columns["with_session"] = with_session
    return {"person": person, "date": day, "value": value, "sd": sd, "prior_sd": prior_sd, **columns}


def test_a_day_is_what_its_people_say_together_with_one_prior():
    """Two people of one Gaussian world: the exact posterior, not the mean of two that each lean on the prior."""
    prior_sd, seen, noise = 0.01, (0.02, 0.03), 0.005
    alone = 1.0 / noise**2 + 1.0 / prior_sd**2
    rows = [instrument(f"p{k}", "2026-05-03", y / noise**2 / alone, alone**-0.5) for k, y in enumerate(seen)]
    rows += [instrument("known", "2026-05-03", 9.0, 1e-6, with_session=True), instrument("when", None, 9.0, 1e-6)]
    (part,) = drift(pd.DataFrame(rows))
    (line,) = part.figure.data
    total = 2.0 / noise**2 + 1.0 / prior_sd**2
    assert line["x"] == ["2026-05-03"]
    assert line["y"] == pytest.approx([100.0 * sum(seen) / noise**2 / total])
    assert line["error_y"]["array"] == pytest.approx([196.0 * total**-0.5])
    assert part.text == ("2 people on 1 day; the date is unknown for 1 more.",)


def test_without_a_date_the_page_says_who_could_say_it():
    (part,) = drift(pd.DataFrame([instrument("a", None, 0.0, 0.01)]))
    assert part.figure is None
    assert "date = 2026-05-03 under [instruments]" in part.text[0]
    assert not list(drift(pd.DataFrame([instrument("a", None, 0.0, 0.01)])[:0]))
