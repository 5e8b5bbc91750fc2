"""A running `kinertia app`, and a tab on it."""

import pytest

from kinertia.cli.measured_demo import FILES


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
    from app_server import running

    with running(tmp_path_factory.mktemp("app") / "library", FILES) as served:
        yield served


@pytest.fixture
def tab(browser, app):
    from app_tab import Tab

    opened = Tab(browser, app).home()
    yield opened
    opened.page.close()
