"""The wheel on every system that the classifiers name: nobody has to compile anything, and no name in it is forbidden.

uv resolves for another system as if it ran there; pip would evaluate the markers of the system that it runs on.
"""

import os
import re
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from kinertia.findings.rule import FAMILIES

ROOT = Path(__file__).parents[2]
OLDEST = {
    # platform of uv, and the oldest macOS that all packages have wheels for (SciPy's for ARM begin at 12)
    "win_amd64": ("x86_64-pc-windows-msvc", ""),
    "macosx_12_0_arm64": ("aarch64-apple-darwin", "12.0"),
    "macosx_10_15_x86_64": ("x86_64-apple-darwin", "10.15"),
    "manylinux_2_28_x86_64": ("x86_64-manylinux_2_28", ""),
    "manylinux_2_28_aarch64": ("aarch64-manylinux_2_28", ""),
}
WITHOUT_EZC3D = {"manylinux_2_28_aarch64"}
PYTHONS = ("3.11", "3.14")
WITHOUT_NUMBA = {("macosx_10_15_x86_64", "3.14")}
"""Nobody makes wheels of Numba for Intel Macs any more; its last ones are for Python 3.13."""
MOST_MB = 600


def _uv(*arguments, text="", macos=""):
    environment = os.environ | {"UV_PYTHON_DOWNLOADS": "never"} | ({"MACOSX_DEPLOYMENT_TARGET": macos} if macos else {})
    return subprocess.run(
        [sys.executable, "-m", "uv", *arguments],
        input=text,
        cwd=ROOT,
        env=environment,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )


@pytest.fixture(scope="module")
def index():
    """Skips where the package index cannot be reached."""
    pytest.importorskip("uv", reason='needs uv: pip install -e ".[test]"')
    asked = _uv("pip", "compile", "--quiet", "-", text="threadpoolctl")
    if "Failed to fetch" in asked.stderr:
        pytest.skip("needs the package index: " + asked.stderr.strip().splitlines()[-1].strip())
    assert asked.returncode == 0, asked.stderr


@pytest.fixture(scope="module")
def wheel(index, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    built = _uv("build", "--wheel", "--quiet", "--out-dir", folder)
    assert built.returncode == 0, built.stderr
    (path,) = folder.glob("*.whl")
    return path


def _resolved(wheel, system, python, *options, extra=""):
    """Versions that an installation would take, by package."""
    platform, macos = OLDEST[system]
    done = _uv(
        *("pip", "compile", "--quiet", "--no-header", "--no-annotate", "--python-platform", platform),
        *("--python-version", python, *options, "-"),
        text=f"kinertia{extra} @ {wheel.as_uri()}",
        macos=macos,
    )
    assert done.returncode == 0, done.stderr
    return dict(line.split("==") for line in done.stdout.splitlines() if "==" in line)


@pytest.mark.slow
@pytest.mark.parametrize(("system", "python"), [(s, p) for s in OLDEST for p in PYTHONS if (s, p) not in WITHOUT_NUMBA])
def test_everything_it_needs_has_a_wheel(wheel, system, python):
    with ThreadPoolExecutor() as both:
        choices = ("--only-binary", ":all:"), ()
        wheels, newest = both.map(lambda options: _resolved(wheel, system, python, *options), choices)
    # pip takes the newest version, with a wheel or without: it has to be one with a wheel
    assert newest == wheels
    assert {"numpy", "scipy", "numba", "pandas"} <= set(wheels)
    assert ("ezc3d" in wheels) == (system not in WITHOUT_EZC3D)


@pytest.mark.slow
@pytest.mark.parametrize("system", sorted(WITHOUT_EZC3D))
def test_ezc3d_is_left_out_only_where_it_has_no_wheel(index, system):
    """Once this fails, the marker in pyproject.toml can go. Also: a wheel that is missing is noticed."""
    platform, macos = OLDEST[system]
    options = ("pip", "compile", "--quiet", "--python-platform", platform, "--python-version", PYTHONS[0])
    done = _uv(*options, "--only-binary", ":all:", "-", text="ezc3d", macos=macos)
    assert done.returncode != 0
    assert "no usable wheels" in done.stderr, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("system", "python"), sorted(WITHOUT_NUMBA))
def test_numba_is_missing_only_where_it_has_no_wheel(index, system, python):
    """Once this fails, the exception can go."""
    platform, macos = OLDEST[system]
    options = ("pip", "compile", "--quiet", "--python-platform", platform, "--python-version", python)
    done = _uv(*options, "--only-binary", ":all:", "-", text="numba", macos=macos)
    assert done.returncode != 0
    assert "no usable wheels" in done.stderr, done.stderr


@pytest.mark.slow
def test_tools_of_the_tests_install_on_windows(wheel):
    # yeadon comes as source only, but of pure Python
    options = ("--only-binary", ":all:", "--no-binary", "yeadon")
    tools = _resolved(wheel, "win_amd64", "3.12", *options, extra="[test]")
    assert "opensim" in tools
    assert {"dask", "distributed", "pyarrow"} <= set(tools)
    assert "pin" not in tools


@pytest.mark.slow
def test_it_is_one_wheel_for_all_systems_with_names_that_all_allow(wheel):
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert len({name.casefold() for name in names}) == len(names)
    for part in {part for name in names for part in name.split("/")}:
        assert not re.search(r'[<>:"\\|?*\x00-\x1f]|[ .]$', part), part
        assert not re.fullmatch(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", part, re.IGNORECASE), part


@pytest.mark.slow
def test_it_carries_the_catalogue_of_findings(wheel):
    with zipfile.ZipFile(wheel) as archive:
        assert {f"kinertia/findings/catalogue/{family}.toml" for family in FAMILIES} <= set(archive.namelist())


@pytest.mark.slow
def test_evidence_is_not_in_it(wheel):
    with zipfile.ZipFile(wheel) as archive:
        folders = {name.split("/")[0] for name in archive.namelist()}
    assert {folder for folder in folders if not folder.endswith(".dist-info")} == {"kinertia"}


@pytest.mark.slow
def test_what_it_needs_is_small(wheel, tmp_path):
    """Size of all files of the wheels here; pip adds the bytecode that it compiles from them, a good quarter more."""
    installed = _uv("pip", "install", "--quiet", "--target", tmp_path / "packages", wheel)
    assert installed.returncode == 0, installed.stderr
    sizes = (path.stat().st_size for path in (tmp_path / "packages").rglob("*") if path.is_file())
    assert sum(sizes) / 1e6 <= MOST_MB
