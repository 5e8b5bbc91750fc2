"""What the report says, without a browser: words, safety of the page, provenance."""

import hashlib
import os
import re
import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from command_line import run
from found import FAULT_FREE, UNEXPLAINED, UNUSABLE
from kinertia.diagnostics.result.suitability import Suitability
from kinertia.estimation.result.leg_moments import coverage_sentence
from kinertia.findings.finding import Severity, finding
from kinertia.io.subject.provenance import provenance_of
from kinertia.io.subject.reader import read_subject
from kinertia.model.bsp import BodySegmentParameters
from kinertia.report.figures.figure import packed_script
from kinertia.report.pages.finding_view import FindingView
from kinertia.report.pages.headline import Purpose, impossible, purposes, without_repetition, words
from kinertia.report.pages.page import bsp_rows, render
from kinertia.report.wording import fixed
from report_page import Elements, figures_of

MOST_BYTES = 3_200_000
SHOWN = ["verdict", "next", "cycle", "angles", "moments", "powers", "forces"]
"""What people come for, in this order; all else is folded below."""
PARTS = [
    *SHOWN, "remarks", "findings", "outputs", "coordinates", "stance-walk", "moments-over-time", "kinematics", "body",
    "bsp", "changed", "residuals", "markers", "view", "computed", "explained",
]  # fmt: skip


@pytest.mark.parametrize(
    ("segments", "together"),
    [
        (("use", "use", "use"), "use"),
        (("use", "use with care", "do not use"), "use with care"),
        (("do not use", "do not use", "do not use"), "do not use"),
    ],
)
def test_purposes_follow_the_outputs(segments, together):
    names = ("segment masses", "centres of mass", "moments of inertia")
    outputs = [
        Suitability("joint moments", "use with care", "3 N; see P213", ("P213",)),
        *(Suitability(name, use, "why") for name, use in zip(names, segments, strict=True)),
        Suitability("motion", "use", "why"),
    ]
    moments, parameters, opensim = purposes(outputs, no_body=False)
    assert (moments.use, parameters.use, opensim.use) == ("use with care", together, "use with care")
    assert moments.reason == opensim.reason == "3 N; see P213"
    *_, opensim = purposes(outputs, no_body=True)
    assert opensim.use == "do not use"
    assert "R202" in opensim.reason


def test_a_light_body_that_was_not_estimated_does_not_keep_simulations_from_using_the_others():
    """Its impossible inertia is the model's own: R202 is an INFO there."""
    for severity, no_body in ((None, True), (Severity.INFO, False)):
        assert impossible(SimpleNamespace(findings=(finding("R202", None, severity),))) is no_body


def test_estimates_far_from_the_literature_are_named(fit):
    table = fit.literature.table().copy()
    row = fit.literature.segments.index("shank_l")
    table[row, 2] -= 2.5 * fit.posterior.prior_sd[row, 2]
    moved = replace(fit, estimate=BodySegmentParameters.from_table(fit.literature.segments, table))
    (said,) = words(moved).departures
    assert said.startswith("CoM upward of shank, left:")
    assert "-2.5 prior SDs" in said
    table[row, 2] += 0.6 * fit.posterior.prior_sd[row, 2]
    near = replace(fit, estimate=BodySegmentParameters.from_table(fit.literature.segments, table))
    assert words(near).departures == ()
    table[:, 0] += 3.0 * fit.posterior.prior_sd[:, 0]
    table[:, 4] += 4.0 * fit.posterior.prior_sd[:, 4]
    many = words(replace(fit, estimate=BodySegmentParameters.from_table(fit.literature.segments, table))).departures
    assert all("+4.0" in sentence for sentence in many[:12])
    assert "12 more" in many[12]


def test_what_the_data_say_is_counted(fit, two_level):
    sd = fit.posterior.prior_sd.copy()
    sd[0] *= np.sqrt(1 - 0.8)
    sd[1] *= np.sqrt(1 - 0.5)
    knowledge = words(replace(fit, posterior=replace(fit.posterior, sd=sd))).knowledge
    assert re.findall(r"(?<!\S)\d+(?= )", knowledge[0])[:5] == ["120", "10", "75", "10", "100"]
    masses = [sentence.partition(": ")[2] for sentence in knowledge[1:4]]
    assert masses == ["pelvis", "torso", "thigh; shank; foot; upper arm; forearm"]
    assert knowledge[4].startswith("17 combinations")
    (only,) = words(two_level).knowledge
    assert "no error bars" in only


@pytest.fixture(scope="module")
def of_model(fit):
    """The demo's fit as if its forearms were held and its start an OpenSim model's."""
    rows = [fit.estimate.segments.index(name) for name in ("forearm_r", "forearm_l")]
    prior_sd, sd = fit.posterior.prior_sd.copy(), fit.posterior.sd.copy()
    prior_sd[rows] = sd[rows] = 0.0
    table = fit.estimate.table().copy()
    table[rows] = fit.literature.table()[rows]
    estimate = BodySegmentParameters.from_table(fit.estimate.segments, table)
    return replace(
        fit,
        estimate=estimate,
        posterior=replace(fit.posterior, prior_sd=prior_sd, sd=sd),
        file=SimpleNamespace(bsp=fit.estimate),
    )


def test_held_segments_are_named_and_not_counted(of_model):
    knowledge = words(of_model).knowledge
    assert knowledge[0].startswith("of 100 parameters")
    (fixed_segments,) = [sentence for sentence in knowledge if "forearm" in sentence]
    assert fixed_segments.endswith("not estimated: forearm")
    page = render(of_model)
    figures = figures_of(page)
    for figure in ("changes", "bsp-change", "bsp-departure", "products-change"):
        for axis in ("yaxis", "yaxis2"):
            assert not any("forearm" in name for name in figures[figure]["layout"][axis]["ticktext"])
    assert len(figures["bsp-information"]["layout"]["yaxis"]["ticktext"]) == 10
    assert "not estimated: forearm" in Elements(page).text
    held = [row for row in bsp_rows(of_model) if row["segment"].startswith("forearm")]
    assert len(held) == 20
    assert {row["evidence"] for row in held} == {"held"}
    assert page.count("<td>fixed</td>") == 20
    assert "nan" not in re.findall(r'data-sort="([^"]*)"', page)


def test_start_is_called_what_it_is(fit, of_model):
    for result, word in ((fit, "literature values"), (of_model, "the model's own values")):
        assert any(word in (trace.name or "") for trace in result.plot.residuals().data)
        assert any(word in (trace.name or "") for trace in result.plot.moments().data)
    assert "literature" not in Elements(render(replace(of_model, findings=(), notes=()))).text.lower()


def test_changes_are_counted_from_the_prior_and_called_so(fit):
    told = replace(fit, posterior=replace(fit.posterior, prior_mean=fit.estimate))
    captions = [render(result).count("Zero is the prior.") for result in (fit, told)]
    assert captions[0] == 0
    assert captions[1] >= 2


def test_numbers_in_the_table_have_the_digits_of_their_unit(fit):
    for row in bsp_rows(fit):
        texts = [row[name]["text"] for name in ("before", "estimate", "prior_sd", "sd")]
        assert not any("e" in text or (text.startswith("-") and float(text) == 0) for text in texts)
        digits = {len(text.partition(".")[2]) for text in texts}
        assert len(digits) == 1
        assert digits <= ({2} if "(kg)" in row["parameter"] else {1} if "(mm)" in row["parameter"] else {4, 5, 6})
        assert float(row["sd"]["text"]) == pytest.approx(row["sd"]["value"], rel=0.06, abs=0.051)
    assert fixed(-0.04, 1) == fixed(-0.04, 1, sign=True) == "0.0"
    assert (fixed(0.06, 1, sign=True), fixed(-0.06, 1)) == ("+0.1", "-0.1")
    assert not re.search(r"(?<![\d.])[-+]0\.0+(?!\d)", Elements(render(fit)).text)


def test_rows_changed_beyond_their_error_bars_are_marked(fit, two_level, of_model):
    """And those of products of inertia, so that the page can leave them out."""
    table = fit.literature.table().copy()
    table[2, 0] += 2.0 * fit.posterior.sd[2, 0]
    table[5, 8] -= 1.9 * fit.posterior.sd[5, 8]
    moved = replace(fit, estimate=BodySegmentParameters.from_table(fit.literature.segments, table))
    (row,) = [row for row in bsp_rows(moved) if row["changed"]]
    assert (row["segment"], row["parameter"]) == ("thigh, right", "mass (kg)")
    assert [row["parameter"] for row in bsp_rows(fit)[:10] if row["product"]] == [
        f"I{k} (kg m2)" for k in ("xy", "xz", "yz")
    ]
    page = render(moved)
    assert (page.count('<tr class="changed'), page.count('<tr class="unchanged')) == (1, 119)
    assert len(re.findall(r'<tr class="\w+ product', page)) == 36
    assert not any(row["changed"] for row in bsp_rows(of_model) if row["held"])
    same = two_level.estimate.table() == two_level.literature.table()
    assert [row["changed"] for row in bsp_rows(two_level)] == (~same).ravel().tolist()


def test_the_change_of_motion_is_told_against_inverse_kinematics(fit):
    trial = fit.trials[0]
    q = trial.kinematics.ik.q[trial.kinematics.frames].copy()
    knee = fit.skeleton.coordinates.index("knee_angle_l")
    q[:, knee] += np.radians(12.0)
    q[:, 2] -= 0.030
    turned = replace(trial, motion=replace(trial.motion, q=q))
    said = words(replace(fit, trials=(turned,))).motion[1]
    assert "most of all knee flexion, left by 12.0" in said
    assert f"changed by {12 / np.sqrt(24):.1f} degrees" in said
    assert "moved by 30 mm (RMS), 30 mm at most" in said


def test_page_has_all_parts_and_is_small_enough(page):
    elements = Elements(page)
    sections = [attrs["id"] for attrs in elements.named("section")]
    assert [name for name in PARTS if name in sections] == sections
    assert set(PARTS) - set(sections) <= {"explained"}
    assert len(page.encode()) <= MOST_BYTES
    assert page.count(packed_script()) == 1
    ids = [attrs["id"] for _, attrs in elements.tags if "id" in attrs]
    assert len(set(ids)) == len(ids)
    links = {attrs["href"].removeprefix("#") for attrs in elements.named("a")}
    assert links <= set(ids)
    assert {*SHOWN[2:], "more"} <= links, "the first two are on the first screen"
    folded = [attrs["id"] for attrs in elements.named("section") if attrs.get("class") == "more"]
    assert folded == [name for name in sections if name not in (*SHOWN, "remarks")]


def test_what_is_not_folded_is_short(page):
    """A clinician reads it on one screen after another: at most 1,500 words."""
    shown = re.sub(
        r"<details.*?</details>", "", re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL), flags=re.DOTALL
    )
    assert 200 < len(re.sub(r"<[^>]+>", " ", shown).split()) <= 1500


def test_legends_have_at_most_four_entries(page):
    for name, figure in figures_of(page).items():
        entries = {trace["name"] for trace in figure["data"] if trace.get("showlegend", "name" in trace)}
        assert len(entries) <= 4, (name, entries)


def test_a_reason_is_given_once():
    moments, parameters, opensim = (Purpose(name, "use", "whole stride; 2 N") for name in ("Moments", "B", "OpenSim"))
    shown = without_repetition([moments, parameters._replace(reason="other"), opensim], "whole stride")
    assert [purpose.reason for purpose in shown] == ["2 N", "other", "same as for moments"]
    assert [purpose.use for purpose in shown] == ["use"] * 3


def test_every_picture_has_words_and_data(page):
    elements = Elements(page)
    pictures = [attrs for tag, attrs in elements.tags if attrs.get("class") == "plot" or tag == "canvas"]
    assert len(pictures) >= 7
    for attrs in pictures:
        assert attrs["role"] == "img"
        assert len(attrs["aria-label"]) > 40
    drawn = {attrs["id"] for attrs in elements.named("div") if attrs.get("class") == "plot"}
    assert drawn == set(figures_of(page))


def test_page_asks_for_nothing_outside_itself(page):
    elements = Elements(page)
    for _, attrs in elements.tags:
        assert not attrs.get("src")
        assert attrs.get("href", "#").startswith("#")
    (policy,) = [attrs["content"] for attrs in elements.named("meta") if "http-equiv" in attrs]
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    styles = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
    assert not any("url(" in style or "@import" in style for style in styles)


EVIL = '</script><script>alert("x")</script><img src=x onerror=alert(1)>'


def test_names_cannot_become_markup(fit, page):
    subject = fit.subject.model_copy(update={"name": f"<script>{EVIL}"})
    trial = fit.trials[0]
    kinematics = trial.kinematics
    label = kinematics.ik.labels[0]
    markers = kinematics.trial.markers
    named = [EVIL if known_label == label else known_label for known_label in markers.labels]
    ik = replace(
        kinematics.ik,
        labels=tuple(EVIL if known_label == label else known_label for known_label in kinematics.ik.labels),
    )
    renamed = replace(kinematics.trial, name=f"walk {EVIL}", markers=replace(markers, labels=tuple(named)))
    skeleton = fit.skeleton.with_markers(
        [replace(m, label=EVIL) if m.label == label else m for m in fit.skeleton.markers]
    )
    evil = replace(
        fit,
        subject=subject,
        skeleton=skeleton,
        trials=(replace(trial, kinematics=replace(kinematics, trial=renamed, ik=ik)),),
        findings=tuple(
            replace(reported, where=replace(reported.where, trial=EVIL, plate=EVIL)) for reported in UNUSABLE
        ),
        left_out=(EVIL,),
        notes=(EVIL,),
    )
    made = Elements(render(evil))
    usual = Elements(page)
    assert len(made.named("script")) == len(usual.named("script"))
    assert not made.named("img")
    assert EVIL in made.text
    assert subject.name in made.text
    for html in (evil._repr_html_(), evil.trials[0].kinematics.trial._repr_html_()):
        assert not Elements(html).named("script")
        assert EVIL in Elements(html).text
    labels = figures_of(render(evil))["trial1-markers"]["data"][0]["y"]
    assert any("&lt;/script&gt;" in shown_label for shown_label in labels)
    assert not any("<" in shown_label for shown_label in labels)


def test_report_shows_findings_notes_and_settings(fit):
    shown = replace(fit, findings=UNUSABLE, rules=61, left_out=("walk 2",), notes=("the dog bites",))
    page = render(shown)
    elements = Elements(page)
    open_ones = [reported for reported in UNUSABLE if reported.status != "ignored"]
    for text in ("the dog bites", "simultaneous", "hip_centre", "numpy", fit.subject.name, "walk 2"):
        assert text in elements.text
    view = FindingView([shown.overview])
    cards = [card for _, some in view.sections for card in some]
    for text in (*(card.group.message for card in cards), *(row.size for row in view.corrections), UNEXPLAINED.message):
        assert text in elements.text
    for text in ("all plates", "position x", "hip_r", "centre change z", "synchronisation"):
        assert text in elements.text
    explained = {attrs["id"] for attrs in elements.named("h3") if attrs.get("id", "").startswith("explain-")}
    assert explained == {f"explain-{reported.code}" for reported in open_ones}
    (headline,) = re.findall(r'<p class="headline (\w+)', page)
    assert headline == "error"


def test_the_first_screen_of_fault_free_data_has_nothing_to_do(fit):
    page = render(replace(fit, findings=FAULT_FREE, rules=61))
    assert '<ol class="steps' not in page
    assert page.count('<article class="finding') == 0
    assert re.findall(r'<p class="headline (\w+)', page) == ["info"]


def test_without_a_stride_the_verdict_says_what_is_known_of_stance(fit, page, monkeypatch):
    known = coverage_sentence(fit.trials)
    assert Elements(page).text.count(known) == 1 + 1  # with the strides, and in the reason of the table of outputs
    monkeypatch.setattr("kinertia.estimation.result.trial_fit.strides_of", lambda *_: ())
    short = replace(fit, trials=tuple(replace(trial) for trial in fit.trials))
    known = coverage_sentence(short.trials)
    assert known.startswith("right: ")
    assert Elements(render(short)).text.count(known) == 1 + 1


def test_two_level_report_says_that_it_has_no_error_bars(two_level):
    elements = Elements(render(two_level))
    assert "no error bars" in elements.text
    assert "evidence" not in elements.text
    assert {attrs["id"] for attrs in elements.named("section")} >= set(PARTS) - {"explained"}


def test_command_and_hashes_are_in_the_report(demo_run):
    demo, folder = demo_run
    text = (folder / "report.html").read_text()
    shown = Elements(text).text
    assert f"kinertia demo -o {folder}" in shown
    for name in ("static.trc", "walk.trc", "walk_grf.mot"):
        assert hashlib.sha256((folder / "lab" / name).read_bytes()).hexdigest() in shown
    assert "neither command nor files" not in shown
    assert "neither command nor files" in render(demo.fit)


@pytest.mark.slow
def test_the_command_in_a_report_repeats_the_fit(demo_run, tmp_path):
    lab, folder = demo_run[1] / "lab", tmp_path / "my results"
    given = ("fit", lab / "walk.trc", "--forces", lab / "walk_grf.mot", "--static", lab / "static.trc")
    given = (*given, "--mass", 72.6, "--height", 1.803, "--sex", "male", "-o", folder)
    assert run(*given).status in (0, 1)
    shown = Elements((folder / "report.html").read_text()).text
    command = next(line for line in shown.splitlines() if "kinertia fit" in line)
    again = shlex.split(command[command.index("kinertia fit") :])
    assert sorted(again[1:]) == sorted(map(str, given))
    results = (folder / "bsp.csv").read_text()
    assert run(*again[1:]).status in (0, 1)
    assert (folder / "bsp.csv").read_text() == results


def test_a_marker_set_of_the_user_counts_as_a_file(demo_run, tmp_path):
    demo, _ = demo_run
    set_file = tmp_path / "mine.toml"
    set_file.write_text("x")
    wanted = read_subject(demo.subject_file)
    wanted = wanted.model_copy(update={"model": wanted.model.model_copy(update={"markers": set_file})})
    files = provenance_of(wanted, "kinertia fit subject.toml").files
    above = Path(os.path.commonpath([tmp_path, demo.subject_file.parent]))
    assert files[str(set_file.relative_to(above))] == hashlib.sha256(b"x").hexdigest()
    assert len(files) == 4
    assert set(provenance_of(read_subject(demo.subject_file), "").files) == {"static.trc", "walk.trc", "walk_grf.mot"}
