"""Pictures of notebooks: those of the report, by the names that files for papers have; never an empty cell."""

from dataclasses import replace

import plotly.graph_objects as go
import pytest

from kinertia.errors import KinertiaError
from kinertia.estimation.result.figure_names import FitPictures
from kinertia.report.figures.journal_figure import FOR_PAPERS
from report_page import figures_of


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
