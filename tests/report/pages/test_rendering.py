"""Pages of `plan`, `crossval` and the studies show the numbers of their results."""

import json

import plotly.graph_objects as go
import pytest

from kinertia.cli.common import print_json
from kinertia.report.pages.rendering import Part, render_parts
from kinertia.report.pages.study_pages import (
    crossval_rows,
    crossval_sentence,
    crossval_summary,
    plan_rows,
    render_crossval,
    render_plan,
    save_plan,
)
from report_page import figures_of
from study_results import HELD_OUT, PLAN


def drawn(page):
    figures = figures_of(page)
    for figure in figures.values():
        go.Figure(figure["data"], figure["layout"])
    return figures


def test_plan_draws_counts_and_shares(tmp_path):
    page = render_plan(PLAN)
    bars, dots = drawn(page).values()
    counts = [PLAN.counts(names) for names in PLAN.sd]
    assert [trace["x"] for trace in bars["data"]] == [
        [count[word] for count in counts] for word in ("measured", "informed", "assumed")
    ]
    assert [trace["x"] for trace in dots["data"]] == [pytest.approx([0.4, 0.9, 0.2])] * 3
    assert [row[0] for row in plan_rows(PLAN)] == ["walk", "<i>squat", "walk + <i>squat"]
    assert "<i>squat" not in page
    folder = save_plan(PLAN, tmp_path / "out")
    assert {path.name for path in folder.glob("[!.]*")} == {"plan.html", "plan.csv", "plan.json"}
    assert json.loads((folder / "plan.json").read_text(encoding="utf-8"))["recordings"]["walk"] == counts[0]


def test_cross_validation_says_how_many_trials_are_explained_better():
    assert "1 of 2 held-out trials" in crossval_sentence(HELD_OUT)
    (figure,) = drawn(render_crossval(HELD_OUT, "literature")).values()
    by_panel = [trace["x"] for trace in figure["data"]]
    assert by_panel[:2] == [[200.0, 100.0], [150.0, 120.0]]
    assert by_panel[6:] == [pytest.approx([10.0, 8.0]), pytest.approx([9.0, 8.0])]
    assert crossval_rows(HELD_OUT, "literature")[1] == ["one", "others", "150", "8.0", "3.0", "9.0"]
    assert crossval_summary(HELD_OUT)["held_out"][0]["estimate"]["force_rms_n"] == 8.0


def test_a_page_without_figures_carries_no_plotly():
    page = render_parts("Title", "Lead.", [Part("Part", ("Text <b>.",), headings=("a", "b"), rows=[["x", "1"]])])
    assert len(page) < 20_000
    assert "Text &lt;b&gt;." in page


def test_json_for_scripts_has_no_words_that_json_does_not_know(capsys):
    print_json({"a": float("nan"), "b": [1.5, float("inf"), (2, "x")], "c": None, "d": True})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1.5, None, [2, "x"]], "c": None, "d": True}
