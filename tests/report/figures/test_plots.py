"""Figures for papers: what matplotlib draws is what the report's figures say."""

import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest
from matplotlib import rc_context
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.colors import to_hex

from kinertia.errors import FileError, KinertiaError, how_to_install
from kinertia.estimation.result.figure_names import FitPictures
from kinertia.report.figures.bsp_figures import change_figure
from kinertia.report.figures.cycle_figures import cycle_figure
from kinertia.report.figures.plots import FOR_PAPERS, FitFigures, drawing
from report_page import figures_of


def panel(figure, title):
    """The panel of this title, and what the report's figure has there."""
    drawn = drawing(figure)
    titles = [note["text"].removeprefix("<b>").removesuffix("</b>") for note in figure.layout["annotations"]]
    assert [axes.get_title(loc="left").replace("\n", " ") for axes in drawn.axes] == titles
    k = titles.index(title)
    return drawn.axes[k], [trace for trace in figure.data if trace["xaxis"] == (f"x{k + 1}" if k else "x")]


def test_curves_are_those_of_the_report(fit):
    axes, traces = panel(cycle_figure(fit, "moment"), "Knee moment, flexion + (N m/kg)")
    whole = [line for line in axes.get_lines() if len(line.get_xdata()) == 101]
    lines = {(to_hex(line.get_color()), line.get_linestyle()): line for line in whole}
    for side, colour in (("right", "#0072b2"), ("left", "#d55e00")):
        for name, dash in ((f"{side}, one stride", "-"), (f"{side}, literature values", ":")):
            (trace,) = [drawn for drawn in traces if drawn["name"] == name]
            line = lines[colour, dash]
            np.testing.assert_array_equal(line.get_xdata(), np.arange(101))
            np.testing.assert_array_equal(line.get_ydata(), trace["y"])
    (band,) = [drawn for drawn in traces if drawn["name"] == "right, 95 % of the estimate"]
    outline = next(patch for patch in axes.patches if to_hex(patch.get_facecolor()) == "#0072b2").get_xy()
    y = np.asarray(band["y"], dtype=float)
    assert set(np.round(outline[:, 1], 6)) == set(np.round(y[np.isfinite(y)], 6))
    assert axes.get_xlim() == (0, 100)


def test_no_title_is_broken_inside_its_unit(fit):
    titles = [axes.get_title(loc="left") for axes in drawing(cycle_figure(fit, "moment")).axes]
    assert "Trunk moment, bending right +\n(N m/kg)" in titles
    assert all("(N m/kg)" in title for title in titles)


def test_error_bars_are_those_of_the_report(fit):
    axes, traces = panel(change_figure(fit), "CoM forward (mm)")
    (estimate,) = [trace for trace in traces if trace["name"] == "estimate, 95 %"]
    bars = next(collection for collection in axes.collections if to_hex(collection.get_color()[0]) == "#0072b2")
    for segment, x, y, half in zip(
        bars.get_segments(), estimate["x"], estimate["y"], estimate["error_x"]["array"], strict=True
    ):
        np.testing.assert_allclose(segment, [(x - half, y), (x + half, y)], rtol=1e-6)
    assert [label.get_text() for label in axes.get_yticklabels()][:2] == ["pelvis", "torso"]
    assert axes.get_ylim()[0] > axes.get_ylim()[1], "downwards"


@pytest.mark.parametrize(("ending", "begin"), [(".svg", b"<?xml"), (".pdf", b"%PDF"), (".PNG", b"\x89PNG")])
def test_a_figure_is_a_file(fit, tmp_path, ending, begin):
    path = fit.figure("forces", tmp_path / f"forces{ending}")
    assert path.read_bytes().startswith(begin)
    if ending == ".svg":
        text = path.read_text(encoding="utf-8")
        assert ">Upward + (% body weight)<" in text, "letters stay letters"
        width, unit = float(text.partition('width="')[2].partition("pt")[0]), 25.4 / 72
        assert width * unit == pytest.approx(180)


@pytest.mark.slow
def test_every_figure_is_drawn_with_and_without_error_bars(fit, two_level):
    for result in (fit, two_level):
        for name in FOR_PAPERS:
            if name == "departures" and result is two_level:
                continue
            drawn = getattr(FitFigures(result, drawing), name)()
            assert all(axes.has_data() for axes in drawn.axes), name
            drawn.draw_without_rendering()


@pytest.mark.parametrize("name", ["moments", "residuals", "bsp"])
def test_the_legend_is_inside_the_figure(fit, name):
    with rc_context({"font.size": 7}):
        drawn = getattr(FitFigures(fit, drawing), name)()
        drawn.draw_without_rendering()
    (legend,) = drawn.legends
    assert legend.get_window_extent().x1 < drawn.bbox.x1


def test_without_strides_moments_are_over_time(fit, tmp_path):
    standing = replace(fit.trials[0])
    standing.__dict__["strides"] = ()
    still = replace(fit, trials=(standing,))
    drawn = FitFigures(still, drawing).moments()
    assert drawn.axes[0].get_xlabel() == "time (s)"
    assert any(isinstance(collection, FillBetweenPolyCollection) for collection in drawn.axes[0].collections), (
        "95 % bands"
    )
    for name in ("moments", "angles"):
        (legend,) = getattr(FitFigures(still, drawing), name)().legends
        assert legend.get_title().get_text() == f"Trial {standing.name}"
    (legend,) = FitFigures(fit, drawing).moments().legends
    assert not legend.get_title().get_text()
    with pytest.raises(KinertiaError, match="no trial of this fit has a stride"):
        still.figure("powers", tmp_path / "powers.svg")


def test_what_cannot_be_drawn_is_told(fit, tmp_path, without):
    with pytest.raises(KinertiaError, match="no figure 'moment'; expected one of moments, angles"):
        fit.figure("moment", tmp_path / "a.svg")
    with pytest.raises(
        KinertiaError, match=r"exists on screen only: fit\.plot\.skeleton\(\); in files, .* bsp, departures"
    ):
        fit.figure("skeleton", tmp_path / "a.svg")
    with pytest.raises(KinertiaError, match="the figure 'bsp' shows all trials; for one trial there are moments"):
        fit.figure("bsp", tmp_path / "a.svg", trial=fit.trials[0].name)
    with pytest.raises(KinertiaError, match="no trial 'nowhere'"):
        fit.figure("residuals", tmp_path / "a.svg", trial="nowhere")
    with pytest.raises(FileError, match=r"'\.docx' is not a figure format; expected one of \.svg"):
        fit.figure("moments", tmp_path / "a.docx")
    with pytest.raises(FileError, match=r"cannot be written: No such file"):
        fit.figure("forces", tmp_path / "nowhere" / "a.png")
    without("matplotlib")
    with pytest.raises(KinertiaError, match=re.escape(how_to_install("plots"))):
        fit.figure("moments", tmp_path / "a.svg")


@pytest.fixture(scope="module")
def still(fit):
    """The fit of somebody who makes no stride."""
    trial = replace(fit.trials[0])
    trial.__dict__["strides"] = ()
    return replace(fit, trials=(trial,))


@pytest.fixture(scope="module")
def without_error_bars(fit):
    return replace(fit, posterior=None)


def names():
    return [name for name in vars(FitPictures) if not name.startswith("_")]


def test_files_for_papers_have_the_names_of_pictures():
    assert set(FOR_PAPERS) < set(names())


def test_every_picture_is_drawn(fit):
    for name in names():
        assert isinstance(getattr(fit.plot, name)(), go.Figure), name


def test_moments_and_angles_are_over_the_cycle_or_of_a_trial_over_time(fit, still):
    trial = fit.trials[0].name
    for name, kind in (("moments", "moment"), ("angles", "angle"), ("powers", "power"), ("forces", "force")):
        assert getattr(fit.plot, name)() == fit.plot.cycles(kind)
    assert fit.plot.moments().layout.xaxis.title.text == "% of the gait cycle"
    assert fit.plot.moments(trial).layout.xaxis.title.text == "time (s)"
    assert fit.plot.angles(trial) == fit.plot.coordinates(trial) == still.plot.angles()
    assert still.plot.moments() == fit.plot.moments(trial)


def test_what_has_no_strides_says_so(still):
    for draw in (still.plot.cycles, still.plot.powers, still.plot.forces):
        with pytest.raises(KinertiaError, match=r"no trial of this fit has a stride.*'moments', 'angles'"):
            draw()


def test_what_has_no_error_bars_says_so(without_error_bars):
    plot = without_error_bars.plot
    for draw in (plot.departures, plot.information):
        with pytest.raises(KinertiaError, match=r"two-level method gives no error bars.*'bsp' has"):
            draw()
    with pytest.raises(KinertiaError, match=r"no error bars.*body\('mass'\)"):
        plot.body("information")
    assert isinstance(plot.body(), go.Figure)


def test_a_trial_without_gaps_says_so(fit):
    seen = fit.plot.gaps()
    if not seen.data:
        assert "was seen in every frame" in seen.layout.annotations[0].text


def test_names_that_are_none_are_told(fit):
    with pytest.raises(KinertiaError, match=f"no trial 'nowhere' in this fit; there are: {fit.trials[0].name}"):
        fit.plot.residuals("nowhere")
    with pytest.raises(KinertiaError, match="no curves 'moments' over the gait cycle; expected one of angle, moment"):
        fit.plot.cycles("moments")
    with pytest.raises(KinertiaError, match="not coloured by 'heads'; expected one of mass, information"):
        fit.plot.body("heads")


@pytest.mark.slow
def test_pictures_are_those_of_the_report(fit, page):
    written = figures_of(page)
    plot, trial = fit.plot, fit.trials[0].name
    for name, figure in (
        ("trial1-residuals", plot.residuals()),
        ("trial1-coordinates", plot.coordinates()),
        ("trial1-moments", plot.moments(trial)),
        ("cycle-moments", plot.moments()),
        ("trial1-markers", plot.markers()),
        ("bsp-change", plot.bsp()),
        ("bsp-departure", plot.departures()),
        ("body-mass", plot.body()),
        ("body-information", plot.body("information")),
        ("bsp-information", plot.information()),
    ):
        figure.layout.meta.pop("trial", None)
        assert figure.to_json() == go.Figure(**written[name]).to_json(), name
    assert len(plot.skeleton().frames) > 30


@pytest.mark.slow
def test_a_page_of_a_notebook_shows_pictures_without_network(fit, browser, tmp_path):
    """By `nbconvert --to html --execute`; the library is in the page once."""
    fit.save(tmp_path / "out")
    notebook = pytest.importorskip("nbformat").v4
    executor, exporter = pytest.importorskip("nbconvert.preprocessors"), pytest.importorskip("nbconvert").HTMLExporter()
    cells = [
        f"import kinertia; fit = kinertia.load_fit({str(tmp_path / 'out')!r})",
        "fit.plot.bsp()",
        "fit.plot.body()",
    ]
    made = notebook.new_notebook(cells=[notebook.new_code_cell(cell) for cell in cells])
    executor.ExecutePreprocessor(kernel_name="python3").preprocess(made)
    (tmp_path / "page.html").write_text(exporter.from_notebook_node(made)[0], encoding="utf-8")
    assert (tmp_path / "page.html").stat().st_size < 8e6
    page = browser.new_page()
    page.route("**/*", lambda route: route.continue_() if route.request.url.startswith("file:") else route.abort())
    page.goto((tmp_path / "page.html").as_uri(), wait_until="domcontentloaded")
    page.wait_for_function("document.querySelectorAll('.plotly-graph-div .main-svg .trace').length > 20")
    assert page.locator(".plotly-graph-div:has(.trace)").count() == 2
    page.close()
