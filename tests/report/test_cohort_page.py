"""The page of a cohort: outcomes and reasons counted, people far from the others linked, mean curves."""

import json
import re
from dataclasses import asdict

import numpy as np
import pandas as pd
import pytest

from kinertia.report.cohort_instruments import drift
from kinertia.report.cohort_outcomes import lead, outcome_parts, outcomes_of, reason_of
from kinertia.report.cohort_page import PAGE, _curves, _mean_curves, _outliers, write_cohort_page
from kinertia.report.cohort_tables import write_tables
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
    assert "10 people; 7 passed every check" in page
    text = re.sub(r"<[^>]+>", " ", page)
    assert re.search(r"trial \.\.\.: no force plates\s+2\s+lost0, lost1", text)
    assert re.search(r"walk: residual force # N is beyond # N\s+1\s+Ben", text)
    links = re.findall(r'<a href="(people/[^"]+)">([^<]+)</a>: ([^<]+)', page)
    assert [link[:2] for link in links] == [("people/Zo%C3%AB%20%26/report.html", "Zoë &amp;")]
    assert links[0][2].startswith("mass of thigh, right, ")
    assert "Knee moment, flexion + (N m/kg)" in json.dumps(figures_of(page))


def test_whose_results_are_usable_with_care_has_not_passed_everything(tmp_path):
    """As the person's own report has it; a person with a warning in two trials is one person."""
    people = [person_record(name, 0, "") for name in ("Anna", "Ben & Co", "Zoë")] + [
        person_record("Eve", 1, "walk7: residual force 12 N is beyond 10 N"),
        person_record(
            "lost", 2, "/data/lost/subject.toml, line 3: forces = 'a.mot': no such file in /data/lost; did you mean"
        ),
    ]
    sound = {
        "trials": [{"name": "walk1"}, {"name": "walk2"}],
        "verdicts": [{"level": "pass", "sentence": "s"}],
        "warnings": [],
    }
    doubted = {
        **sound,
        "warnings": ["walk1: 3 labels jump; look", "walk2: 4 labels jump; look", "plate 1: gain: +3.9 %"],
    }
    careful = {**sound, "verdicts": [{"level": "caution", "sentence": "walk2: marginal (8.5 N); so"}]}
    failed = {**sound, "verdicts": [{"level": "fail", "sentence": "walk1: residual force 12 N is beyond 10 N"}]}
    for name, result in (("Anna", sound), ("Ben & Co", doubted), ("Zoë", careful), ("Eve", failed)):
        (tmp_path / "people" / name).mkdir(parents=True)
        (tmp_path / "people" / name / "fit.json").write_text(json.dumps(result), encoding="utf-8")
    outcomes = outcomes_of(tmp_path, pd.DataFrame([asdict(record) for record in people]))
    assert lead(outcomes).startswith("5 people; 1 passed every check, 2 are usable with care.")
    passed, doubts = outcome_parts(outcomes)
    assert [trace["name"] for trace in passed.figure.data] == [
        "passed (1)",
        "with care (2)",
        "not fitted (1)",
        "a check failed (1)",
    ]
    assert [(row[0], row[1], re.sub("<[^>]+>", "", row[2])) for row in passed.rows] == [
        ("residual force # N is beyond # N", "1", "Eve"),
        ("forces = ...: no such file in ...", "1", "lost"),
    ]
    assert [row[:2] for row in doubts.rows] == [
        ("# labels jump", "1"),
        ("plate #: gain: # %", "1"),
        ("marginal (# N)", "1"),
    ]
    assert doubts.rows[0][2] == '<a href="people/Ben%20%26%20Co/report.html">Ben &amp; Co</a>'


@pytest.mark.parametrize(
    ("sentence", "reason"),
    [
        ("residual at the motion's bandwidth (10 Hz): within OpenSim's guideline", None),
        ("plate 2: x: -7.3 mm, free moment: +4.1 N m/kN (expected within 0.73 N m/kN); check", None),
        ("C:\\lab\\x.toml, line 3: no such file 'a b.mot'; did", "no such file ..."),
        ("no file walks/a.c3d in D:\\lab; did", "no file ... in ..."),
    ],
)
def test_reasons_lose_paths_and_names_but_no_apostrophes_and_units(sentence, reason):
    expected = re.sub(r"[-+]?[\d.]+", "#", sentence.split(";")[0]) if reason is None else reason
    assert reason_of(sentence) == expected


def rows_of(changes, sd):
    """A table of one parameter: change and error bar per person."""
    of = {"segment": "thigh_r", "parameter": "mass", "literature": 8.0, "sd": sd}
    return pd.DataFrame([{"person": f"p{k}", "estimate": 8.0 + change, **of} for k, change in enumerate(changes)])


def test_few_people_who_are_close_together_by_chance_make_no_outlier():
    changes = [0.0, 0.001, -0.001, 0.002, 0.3]
    assert not _outliers(rows_of(changes, 0.5)).listed, "less than its error bar"
    assert len(_outliers(rows_of(changes, 0.01)).listed) == 1
    assert len(_outliers(rows_of(changes, np.nan)).listed) == 1, "two-level has no error bars"


def test_where_nobody_was_measured_mean_curves_have_a_gap():
    every = np.tile([2.0, 4.0, 8.5], (101, 1))
    every[40:60] = 0.0
    spread, line = _curves({("knee_angle_moment", "Knee moment, flexion +"): every}).data
    assert np.isnan(np.asarray(line["y"], dtype=float)[40:60]).all()
    assert np.asarray(line["y"])[:40] == pytest.approx(2.0)
    assert not set(range(40, 60)) & set(np.asarray(spread["x"])[np.isfinite(spread["y"])].tolist())


def test_knees_of_models_with_opposite_signs_are_not_averaged(tmp_path):
    """One model's knee angle is flexion and another's extension: mean 0."""
    titles = {"Anna": ("Knee flexion +", 1.0), "Ben": ("Knee extension +", -1.0)}
    rows = pd.concat(
        pd.DataFrame({"quantity": "knee_angle_angle", "title": title, "percent": np.arange(101), "value": 30.0 * sign})
        for title, sign in titles.values()
    )
    rows.to_parquet(tmp_path / "cycles.parquet")
    (part,) = _mean_curves(tmp_path)
    means = [trace["y"][0] for trace in part.figure.data if trace["name"] == "mean"]
    assert sorted(means) == [-30.0, 30.0]
    assert "panels of their own" in part.caption


@pytest.mark.slow
def test_a_cohort_of_whom_nobody_was_fitted_has_a_page(tmp_path):
    write_tables(tmp_path, [person_record("lost", 2, "no force plates")], with_csv=False)
    write_cohort_page(tmp_path)
    assert "1 people; 0 passed" in (tmp_path / PAGE).read_text(encoding="utf-8")


def instrument(person, day, value, sd, prior_sd=0.01, with_session=False):
    of = {"instrument": "plate 1", "unknown": "gain", "unit": "1", "with_session": with_session}
    return {"person": person, "date": day, "value": value, "sd": sd, "prior_sd": prior_sd, **of}


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
    assert part.text == ("2 people on 1 day; of 1 no date is known.",)


def test_without_a_date_the_page_says_who_could_say_it():
    (part,) = drift(pd.DataFrame([instrument("a", None, 0.0, 0.01)]))
    assert part.figure is None
    assert "date = 2026-05-03 under [instruments]" in part.text[0]
    assert not list(drift(pd.DataFrame([instrument("a", None, 0.0, 0.01)])[:0]))
