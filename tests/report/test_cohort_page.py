"""The page of a cohort: outcomes and reasons counted, people far from the others linked, mean curves."""

import re
from dataclasses import replace

import pytest

from kinertia.io.provenance import VERSION
from kinertia.report.cohort_page import PAGE, write_cohort_page
from kinertia.report.cohort_tables import write_person, write_tables
from kinertia.studies.cohort_record import Place, Record

pytestmark = pytest.mark.slow


def record(name, status=0, sentence=""):
    return Record(name, status, sentence, "9f", VERSION, 1, 1.0)


@pytest.fixture
def cohort(fit, tmp_path):
    """Eight people alike but for small differences, of whom one has a heavy thigh; two without results."""
    records = []
    for k, name in enumerate(["Anna", "Ben", "Zoë &", "D", "E", "F", "G", "H"]):
        table = fit.estimate.table() * (1.0 + 0.001 * k)
        if name == "Zoë &":
            table[2, 0] += 5.0
        person = replace(fit, estimate=type(fit.estimate).from_table(fit.estimate.segments, table))
        Place(tmp_path, name).results.mkdir(parents=True)
        write_person(Place(tmp_path, name).results, name, person)
        records.append(record(name, int(k == 1), "walk: residual force 12.3 N is beyond 10 N; look" if k == 1 else ""))
    records += [record(f"lost{k}", 2, f"/a/b{k}.toml, line {k}: trial 'w{k}': no force plates") for k in range(2)]
    write_tables(tmp_path, records, with_csv=False)
    return tmp_path


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


def test_a_cohort_of_whom_nobody_was_fitted_has_a_page(tmp_path):
    write_tables(tmp_path, [record("lost", 2, "no force plates")], with_csv=False)
    write_cohort_page(tmp_path)
    assert "1 people; 0 passed" in (tmp_path / PAGE).read_text(encoding="utf-8")
