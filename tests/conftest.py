"""Fixtures shared by the tests."""

import builtins
import functools
import importlib.util
import os
import shutil
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

from command_line import Outcome, fitted, run
from kinertia.cli.compiling import compile_once
from kinertia.cli.demo import Demo, run_demo, run_measured_demo
from kinertia.estimation.result.fit import Fit
from kinertia.io import samples
from kinertia.io.recording import read_recording
from kinertia.io.subject.provenance import sha256
from kinertia.motion import workload
from kinertia.report.figures import plots
from kinertia.settings import Settings, Subject
from kinertia.synthetic.laboratory import LabNoise
from kinertia.trial.data import Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate_bsp
from kinertia.workflow.person import Person
from made_codes import MadeCodes
from measured_tests import EMPTY, SAMPLE, MeasuredTests
from once import once
from quick_two_level import given_back
from recordings import NEEDS_MEASURED, SYNTHETIC
from synthetic_lab import WITH_MODEL, synthetic_arguments, write_synthetic_lab
from validation import osim_models
from validation.measured_data import data_folder, find
from validation.walks import fit_arguments

# no test judges time: machines are busy
settings.register_profile("kinertia", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("kinertia")

# one BLAS thread, as long computations have it: here and, by the environment, in processes that tests start
os.environ["OPENBLAS_NUM_THREADS"] = "1"
threadpool_limits(1, user_api="blas")

if "PYTEST_XDIST_WORKER" in os.environ:
    # the other workers use the other cores; processes that tests start have their second thread, and give the same bits
    workload.cores = lambda: 1

LOOKED_FOR = (
    f"measured recordings are looked for in the folder that {samples.VARIABLE} names or, if it names none, in "
    "shared/data beside the repository and in the cache of kinertia demo --measured; other tests ran on synthetic ones"
)
SUBJECT = """# A synthetic person, with the markers of Plug-in Gait.
[subject]
name = "synthetic walker"
sex = "male"
mass_kg = 72.6
height_m = 1.803

[model]
static = "static.c3d"

[[trial]]
markers = "walk.c3d"
"""
FEW_EVALUATIONS = 30
LIMITS = ("kinertia.estimation.two_level._MAX_EVALUATIONS", "kinertia.estimation.two_level._FREE_EVALUATIONS")


def pytest_configure(config):
    config.pluginmanager.register(MadeCodes(config))
    config.pluginmanager.register(MeasuredTests())


def pytest_sessionstart(session):
    """Compile before the workers start, which would each do so, and only once on a machine."""
    if not hasattr(session.config, "workerinput") and not session.config.option.collectonly:
        compile_once(lambda stage, share: print(f"{stage} (a minute)") if share == 0.0 else None)


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: item.get_closest_marker("first") is None)


def pytest_terminal_summary(terminalreporter):
    """One line on what was skipped, in place of one for each."""
    skipped = [report.longrepr[2].removeprefix("Skipped: ") for report in terminalreporter.stats.get("skipped", [])]
    reasons = Counter(NEEDS_MEASURED if reason.startswith(EMPTY) else reason for reason in skipped)
    told = [f"{count} {reason}" for reason, count in reasons.most_common()]
    if NEEDS_MEASURED in reasons:
        told.append(LOOKED_FOR)
    if told:
        terminalreporter.write_line(f"{reasons.total()} skipped: {'; '.join(told)}")


@pytest.fixture(scope="session")
def measured_folder() -> Path:
    """Folder of measured recordings, which are not part of the repository."""
    try:
        return data_folder()
    except FileNotFoundError:
        pytest.skip(NEEDS_MEASURED)


@pytest.fixture(scope="session")
def synthetic_lab(tmp_path_factory) -> Path:
    """Folder of the files of `synthetic_lab.write_synthetic_lab`."""
    return once(tmp_path_factory, "synthetic-lab", write_synthetic_lab)


@pytest.fixture(scope="session")
def c3d_lab(tmp_path_factory, synthetic_lab) -> Path:
    """Folder of those in C3D alone: `static.c3d`, `walk.c3d`, and `subject.toml`."""

    def make(folder: Path) -> Path:
        for name in ("static.c3d", "walk.c3d"):
            shutil.copyfile(synthetic_lab / name, folder / name)
        (folder / "subject.toml").write_text(SUBJECT, encoding="utf-8")
        return folder

    return once(tmp_path_factory, "c3d-lab", make)


@pytest.fixture(scope="session")
def opensim():
    """OpenSim as an oracle, without its log file."""
    module = pytest.importorskip("opensim")
    module.Logger.removeFileSink()
    module.Logger.setLevelString("error")
    return module


@pytest.fixture(scope="session")
def browser():
    """Headless Chromium, without any network of its own."""
    chromium = pytest.importorskip("chromium")
    if not chromium.CHROMIUM.exists():
        pytest.skip(f"needs {chromium.CHROMIUM} (apt-get install chromium)")
    with chromium.playwright.sync_playwright() as engine:
        started = engine.chromium.launch(executable_path=str(chromium.CHROMIUM), args=chromium.FLAGS)
        yield started
        started.close()


@pytest.fixture(scope="session")
def fit_of(request, synthetic_lab, tmp_path_factory):
    """Results of `kinertia fit` for a walk, by its name in `walks.WALKS`, or the "synthetic" one; run once."""
    done = {}

    def get(name):
        if name not in done:
            if name == "synthetic":
                arguments = synthetic_arguments(synthetic_lab)
            else:
                arguments = fit_arguments(request.getfixturevalue("measured_folder"), name)
            done[name] = once(
                tmp_path_factory, f"fit-{name}", lambda made: fitted(made / "results" / "out", *arguments)
            )
        return done[name]

    return get


@pytest.fixture(scope="session")
def fit_with_model(request, synthetic_lab, tmp_path_factory):
    """Folder of results of `kinertia fit` with a user's model, by person and calibration; run once."""
    done: dict[tuple[str, bool], Path] = {}

    def get(name: str, calibrate: bool) -> Path:
        def make(folder: Path) -> Path:
            subject = folder / f"{name}.toml"
            synthetic = name == "synthetic"
            data = synthetic_lab if synthetic else request.getfixturevalue("measured_folder")
            person = WITH_MODEL if synthetic else osim_models.PEOPLE[name]
            subject.write_text(osim_models.subject_file(data, person, calibrate))
            return fitted(folder / "out", subject).folder

        if (name, calibrate) not in done:
            done[name, calibrate] = once(tmp_path_factory, f"model-{name}-{calibrate}", make)
        return done[name, calibrate]

    return get


@pytest.fixture(scope="session")
def demo_command(tmp_path_factory) -> tuple[Demo, Path, Outcome]:
    """Outcome of `run_demo`, its folder, and of the command; the laboratory has noise, and no other errors."""

    def make(made: Path) -> tuple[Demo, Path, Outcome]:
        folder, kept = made / "demo" / "out", []

        def keep(*arguments, **options):
            kept.append(run_demo(*arguments, noise=LabNoise(), **options))
            return kept[-1]

        with mock.patch("kinertia.cli.demo.run_demo", keep):
            outcome = run("demo", "-o", folder)
        assert outcome.status == 0, outcome.err
        return kept[0], folder, outcome

    return once(tmp_path_factory, "demo", make)


@pytest.fixture(scope="session")
def demo_run(demo_command) -> tuple[Demo, Path]:
    """Outcome of `run_demo` and its folder."""
    return demo_command[:2]


@pytest.fixture(scope="session")
def file_of(synthetic_lab):
    """Path of a file by its name as in `recordings`: synthetic, or measured and then perhaps not on this machine."""

    def path(name: str) -> Path:
        if name.startswith(SYNTHETIC):
            return synthetic_lab / name.removeprefix(SYNTHETIC)
        measured = find(name)
        if measured is None:
            pytest.skip(NEEDS_MEASURED)
        return measured

    return path


@pytest.fixture(scope="session")
def recording_of(file_of):
    """Recordings by the names (`file_of`) of the files that `read_recording` takes; each is read once."""

    @functools.cache
    def read(*names: str | None) -> Recording:
        return read_recording(*(None if name is None else file_of(name) for name in names))

    return read


@dataclass(frozen=True)
class MeasuredDemo:
    """A finished `kinertia demo --measured`: its folder, what the terminal showed, and the fit behind it."""

    folder: Path
    outcome: Outcome
    fit: Fit


@pytest.fixture(scope="session")
def sample_walk(tmp_path_factory, synthetic_lab):
    """The sample walk as if it had been downloaded: the measured one, or a synthetic walk in its place.

    Yields the folder that the environment variable names, of which it is a folder.
    """
    measured = find(SAMPLE)
    with pytest.MonkeyPatch.context() as patched:
        if measured is None:
            place = once(tmp_path_factory, "sample", lambda folder: written_sample(synthetic_lab, folder))
            digests = {name: sha256(place / samples.NAME / name) for name in samples.SHA256}
            patched.setattr(samples, "SHA256", digests)
        else:
            place = measured.parents[1]
        patched.setenv(samples.VARIABLE, str(place))
        yield place


def written_sample(lab: Path, folder: Path) -> Path:
    """Files of a synthetic laboratory under the names of the sample walk's."""
    place = folder / samples.NAME
    place.mkdir()
    for name in samples.SHA256:
        shutil.copyfile(lab / name.replace("subject01_", "").replace("walk1", "walk"), place / name)
    return folder


@pytest.fixture(scope="session")
def measured_demo(tmp_path_factory, sample_walk) -> MeasuredDemo:
    """Outcome of `kinertia demo --measured`; run once."""

    def make(made: Path) -> MeasuredDemo:
        folder, fits = made / "out", []

        def kept(*arguments):
            fits.append(run_measured_demo(*arguments))
            return fits[-1]

        with mock.patch("kinertia.cli.demo.run_measured_demo", kept):
            outcome = run("demo", "--measured", "-o", folder)
        assert outcome.status in (0, 1), outcome.err
        return MeasuredDemo(folder, outcome, fits[0])

    kind = "synthetic" if find(SAMPLE) is None else "measured"
    return once(tmp_path_factory, f"measured-demo-{kind}", make)


@pytest.fixture
def few_evaluations(monkeypatch):
    """Stops the estimate early: enough for tests of everything around it."""
    for limit in LIMITS:
        monkeypatch.setattr(limit, FEW_EVALUATIONS)


@pytest.fixture(scope="session")
def short_fit(tmp_path_factory, recording_of):
    """A two-level `Fit` from the Python functions: two short windows of one walk, each as a trial of its own."""

    def make(_: Path) -> Fit:
        walk, static = (recording_of(f"synthetic/{kind}.c3d") for kind in ("walk", "static"))
        inputs = [
            TrialInput(replace(walk, name=name), window, 0.25)
            for name, window in (("early", (1.2, 1.5)), ("late", (1.7, 2.0)))
        ]
        with mock.patch(LIMITS[0], FEW_EVALUATIONS), mock.patch(LIMITS[1], FEW_EVALUATIONS):
            return estimate_bsp(Person(Subject(name="A", sex="male"), inputs, static), Settings(method="two-level"))

    return once(tmp_path_factory, "short-fit", make)


@pytest.fixture(scope="session")
def fit(demo_run):
    """The demo's fit, with error bars."""
    return demo_run[0].fit


@pytest.fixture(scope="session")
def two_level_run(tmp_path_factory) -> tuple[Demo, Path]:
    """The demo by two-level, without error bars, and its folder; its estimate stays at its start."""

    def make(made: Path) -> tuple[Demo, Path]:
        with mock.patch("kinertia.workflow.estimate.estimate_two_level", given_back):
            return run_demo(made / "two-level", noise=LabNoise(), method="two-level"), made / "two-level"

    return once(tmp_path_factory, "two_level", make)


@pytest.fixture(scope="session")
def two_level(two_level_run):
    """The demo's two-level fit."""
    return two_level_run[0].fit


@pytest.fixture
def without(monkeypatch):
    """A machine on which a package is not installed."""

    def remove(name):
        real_spec, real_import = importlib.util.find_spec, builtins.__import__

        def spec(wanted, *args):
            return None if wanted == name else real_spec(wanted, *args)

        def imported(wanted, *args, **kwargs):
            if wanted.split(".")[0] == name:
                raise ImportError(wanted)
            return real_import(wanted, *args, **kwargs)

        monkeypatch.setattr(plots, "find_spec", spec)
        monkeypatch.setattr(builtins, "__import__", imported)

    return remove
