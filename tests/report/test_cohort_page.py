"""The page of a cohort: outcomes and reasons counted, people far from the others linked, mean curves."""

import re

import pandas as pd
import pytest

from kinertia.report.cohort_instruments import drift
from kinertia.report.cohort_page import PAGE, write_cohort_page
from kinertia.report.cohort_tables import write_tables
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
    assert links[0][2].startswith("mass of thigh r, ")
    assert "knee moment (N m/kg)" in page


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
