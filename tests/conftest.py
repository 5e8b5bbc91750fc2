"""Fixtures shared by the tests."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured trials that are not part of the package."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"needs the measured trials in {folder}, which are not part of the package")
    return folder


@pytest.fixture(scope="session")
def opensim():
    """OpenSim as an oracle, without its log file."""
    module = pytest.importorskip("opensim")
    module.Logger.removeFileSink()
    module.Logger.setLevelString("error")
    return module
