"""Where compiled functions are kept, and when they are compiled anew."""

import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from numba.core.registry import CPUDispatcher

import kinertia
from kinertia.model import compiled

PACKAGE = Path(kinertia.__file__).parent
FOLDER = "from kinertia.model.compiled import cache_folder; print(cache_folder())"


@pytest.fixture
def installation(tmp_path):
    """A copy of the package without anything compiled."""
    copy = tmp_path / "site" / "kinertia"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def run(installation: Path, program: str, **environment: str) -> str:
    everything = {**os.environ, "PYTHONPATH": str(installation.parent), **environment}
    done = subprocess.run([sys.executable, "-c", program], env=everything, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_all_files_with_compiled_functions_are_among_the_sources():
    """A change in any of them must not run what an older state of it gave."""
    users = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if re.search(r"^@(compiled|compiled_sums|part|inlined)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert users | {"model/compiled.py"} == set(compiled.SOURCES)


def in_cache(folder: Path) -> dict[str, str]:
    """Environment of a user whose cache is in this folder, on any system but Windows."""
    return {"XDG_CACHE_HOME": str(folder / "cache"), "HOME": str(folder)}


def places(folder: Path) -> tuple[Path, Path]:
    """Where that user's cache may be: on Linux or on macOS."""
    return folder / "cache" / "kinertia", folder / "Library" / "Caches" / "kinertia"


def test_a_change_of_any_source_leads_to_another_folder(installation):
    before = run(installation, FOLDER)
    source = installation / "motion" / "marker_sums.py"
    source.write_text(source.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
    after = run(installation, FOLDER)
    assert after != before
    assert Path(after).parent == installation / "model" / "__pycache__"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows states the cache elsewhere")
def test_other_environments_find_what_is_compiled(installation, tmp_path):
    """In the user's cache, unless their owner has compiled beside the package."""
    user = in_cache(tmp_path)
    compiled_beside = Path(run(installation, FOLDER, **user))
    (compiled_beside / "code").write_text("")
    run(installation, "from kinertia.model.compiled import set_compiled as s; s()", **user)
    assert Path(run(installation, FOLDER, **user)) == compiled_beside
    shutil.rmtree(compiled_beside)
    found = Path(run(installation, FOLDER, **user))
    assert found.parent in places(tmp_path)
    assert found.name == compiled_beside.name
    assert {path.name for path in found.iterdir()} == {"code", compiled._COMPLETE}


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write everywhere")
def test_an_installation_that_may_only_be_read_keeps_them_in_the_users_cache(installation, tmp_path):
    (installation / "model").chmod(0o555)
    folder = run(installation, FOLDER, **in_cache(tmp_path))
    assert Path(folder).parent in places(tmp_path)


@pytest.mark.parametrize("changed", ["numba.__version__", "llvmlite.__version__", "llvm.get_host_cpu_name"])
def test_what_compiles_has_a_folder_of_its_own(monkeypatch, changed):
    before = compiled.cache_folder()
    monkeypatch.setattr(compiled, "_writable", lambda folder: True)
    monkeypatch.setattr(f"kinertia.model.compiled.{changed}", (lambda: "m68k") if "name" in changed else "0.0")
    compiled.cache_folder.cache_clear()
    try:
        assert compiled.cache_folder().name != before.name
    finally:
        compiled.cache_folder.cache_clear()


@pytest.mark.parametrize("place", ["cache", "temporary"])
def test_where_the_package_cannot_be_written_to(monkeypatch, tmp_path, place):
    """The user's cache, or where there is none either, the folder for temporary files."""
    expected = {"cache": tmp_path / "cache", "temporary": tmp_path / "temporary"}[place]
    monkeypatch.setattr(compiled, "_user_cache", lambda: tmp_path / "cache")
    monkeypatch.setattr(compiled.tempfile, "gettempdir", lambda: str(tmp_path / "temporary"))
    monkeypatch.setattr(compiled, "_COMPLETE", "never")
    monkeypatch.setattr(compiled, "_writable", lambda folder: folder.parent == expected)
    compiled.cache_folder.cache_clear()
    try:
        assert compiled.cache_folder().parent == expected
    finally:
        compiled.cache_folder.cache_clear()


def test_the_newest_folders_stay_when_all_is_compiled(monkeypatch, tmp_path):
    folders = [tmp_path / f"kinertia-{number}" for number in range(7)]
    for age, folder in enumerate(folders):
        folder.mkdir()
        os.utime(folder, (1e9 - age, 1e9 - age))
    monkeypatch.setattr(compiled, "cache_folder", lambda: folders[6])
    monkeypatch.setattr(compiled, "_user_cache", lambda: tmp_path)
    assert not compiled.is_compiled()
    compiled.set_compiled()
    assert compiled.is_compiled()
    assert [folder.exists() for folder in folders] == [True] * 4 + [False] * 2 + [True]


def compiled_functions() -> list[CPUDispatcher]:
    """All of the package."""
    names = [name.removesuffix(".py").replace("/", ".") for name in compiled.SOURCES]
    everything = [value for name in names for value in vars(import_module(f"kinertia.{name}")).values()]
    return list({value.py_func: value for value in everything if isinstance(value, CPUDispatcher)}.values())


def test_only_python_calls_what_is_kept():
    """What another compiled function would need of it is not kept."""
    functions = compiled_functions()
    for function in functions:
        python = function.py_func
        called = [python.__globals__.get(name) for name in python.__code__.co_names]
        for other in called:
            assert not isinstance(other, CPUDispatcher) or other.targetoptions.get("no_cpython_wrapper"), other
    assert sum("no_cpython_wrapper" not in function.targetoptions for function in functions) > 10


def test_a_kept_function_gives_in_another_process_what_it_gave(tmp_path):
    (tmp_path / "sums.py").write_text(
        "import numpy as np\n"
        "from kinertia.model.compiled import compiled, part\n"
        "@part\n"
        "def half(x):\n"
        "    return 0.5 * x\n"
        "@compiled\n"
        "def halves(x):\n"
        "    return np.array([half(value) for value in x]), 2 * len(x)\n",
        encoding="utf-8",
    )
    program = (
        f"import sys, numpy as np; from kinertia.model import compiled; from pathlib import Path; "
        f"compiled.cache_folder = lambda: Path({str(tmp_path)!r}); sys.path.insert(0, {str(tmp_path)!r}); "
        "from sums import halves; values, count = halves(np.array([1.0, 2.0])); "
        "print(values.tolist(), count, sum(halves.stats.cache_hits.values()))"
    )
    site = PACKAGE.parent / "kinertia"
    assert [run(site, program) for _ in range(2)] == ["[0.5, 1.0] 4 0", "[0.5, 1.0] 4 1"]


def test_a_kept_function_raises_numbas_errors_without_loading_the_modules_they_come_from(tmp_path):
    (tmp_path / "zeros.py").write_text(
        "import numpy as np\n"
        "from kinertia.model.compiled import compiled, part\n"
        "@part\n"
        "def so_many(n):\n"
        "    return np.zeros(n)\n"
        "@compiled\n"
        "def zeros(n):\n"
        "    return so_many(n)\n",
        encoding="utf-8",
    )
    (tmp_path / "program.py").write_text(
        "import sys\n"
        "from pathlib import Path\n"
        "from kinertia.model import compiled\n"
        "compiled.cache_folder = lambda: Path(__file__).parent\n"
        "from zeros import zeros\n"
        "print(zeros(2).tolist(), 'numba.np.arrayobj' in sys.modules)\n"
        "try:\n"
        "    zeros(-1)\n"
        "except ValueError as error:\n"
        "    print(error)\n",
        encoding="utf-8",
    )
    program = (
        f"import runpy, sys; sys.path.insert(0, {str(tmp_path)!r}); runpy.run_path({str(tmp_path / 'program.py')!r})"
    )
    said = [run(PACKAGE.parent / "kinertia", program).splitlines() for _ in range(2)]
    error = "negative dimensions not allowed"
    assert said == [["[0.0, 0.0] True", error], ["[0.0, 0.0] False", error]]
