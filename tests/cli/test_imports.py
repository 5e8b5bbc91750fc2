"""Every command loads what it uses and no more: half of a fit's time went into modules that it did not need."""

import pytest

from command_line import loaded_after, loaded_by

PICTURES = {"plotly", "matplotlib"}
SLOW = {*PICTURES, "scipy.stats", "scipy.signal"}
SYNTHETIC = {"kinertia.studies", "kinertia.synthetic"}
OSIM_MODELS = {"kinertia.io.opensim.reader", "kinertia.workflow.opensim_model"}
C3D = {"ezc3d", "kinertia.io.c3d.reader", "kinertia.io.c3d.plates"}
SELDOM_NAMED = {
    "kinertia.workflow.known_body",
    "kinertia.estimation.learnt_prior",
    "kinertia.workflow.session",
    "kinertia.io.subject.body_files",
    "kinertia.io.subject.learnt_files",
}


def test_the_version_is_told_without_loading_the_commands():
    loaded = loaded_by("--version")
    assert "kinertia.cli.start" in loaded
    assert not loaded & {*SLOW, "numpy", "scipy", "pandas", "pydantic", "typer", "rich", "kinertia.cli.commands"}


@pytest.mark.slow
def test_a_fit_of_c3d_files_loads_no_pictures_tables_or_studies(c3d_lab, tmp_path):
    loaded = loaded_by("fit", c3d_lab / "subject.toml", "-o", tmp_path / "out", "--quiet")
    assert (tmp_path / "out" / "report.html").is_file()
    assert loaded >= C3D
    assert not loaded & {*SLOW, *SYNTHETIC, *OSIM_MODELS, "pandas", "kinertia.cli.check", "kinertia.cli.studies"}


@pytest.mark.slow
def test_a_fit_of_text_files_does_not_load_the_reader_of_c3d(demo_run, tmp_path):
    loaded = loaded_by("fit", demo_run[1] / "lab" / "subject.toml", "-o", tmp_path / "out", "--quiet")
    assert (tmp_path / "out" / "bsp.csv").is_file()
    assert not loaded & {*SLOW, *SYNTHETIC, *OSIM_MODELS, *C3D, *SELDOM_NAMED, "pandas", "rich"}


@pytest.mark.slow
def test_a_check_loads_no_pictures_or_studies(c3d_lab, tmp_path):
    loaded = loaded_by("check", c3d_lab / "subject.toml", "-o", tmp_path / "out", "--quiet")
    assert (tmp_path / "out" / "check.html").is_file()
    assert not loaded & {*SLOW, *SYNTHETIC, "kinertia.cli.fit"}


@pytest.mark.slow
def test_help_waits_for_nothing_slow():
    """One command after the other in one interpreter, since what one loads stays."""
    loaded = loaded_after(
        "from kinertia.cli.start import main\n"
        "for command in ('demo', 'init', 'crossval', 'plan', 'cohort', 'study'):\n"
        "    sys.argv = ['kinertia', command, '--help']\n"
        "    try:\n        main()\n"
        "    except SystemExit as end:\n        assert end.code in (0, None), end.code"
    )
    assert not loaded & SLOW
