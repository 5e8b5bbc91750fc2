"""A running `kinertia app`, and a tab on it."""

import pytest

from kinertia.cli.demo import write_measured_lab, write_synthetic_lab


@pytest.fixture(scope="module")
def app(tmp_path_factory, sample_walk):
    pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
    from app_server import running

    with running(
        tmp_path_factory.mktemp("app") / "library", {"measured": write_measured_lab, "synthetic": write_synthetic_lab}
    ) as served:
        yield served


@pytest.fixture
def tab(browser, app):
    from app_tab import Tab

    opened = Tab(browser, app).home()
    yield opened
    opened.page.close()
