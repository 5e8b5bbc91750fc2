"""Evidence in its smallest form: that it is computed and fills its pages. No time is judged here."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from validation import cohort_speed, command_speed, field_trials, measured_trials
from validation.long_trials import document, in_own_process


def test_there_and_back_does_not_jump():
    speed = pytest.importorskip("validation.speed")
    np.testing.assert_array_equal(speed.there_and_back(np.array([1, 2, 3]), 3), [1, 2, 3, 2, 1, 2, 3])


def test_farthest_from_the_literature():
    bsp = pd.DataFrame(
        {
            "segment": ["a"] * 2 + ["b"] * 2,
            "parameter": ["mass", "com_x"] * 2,
            "literature": [1.0, 0.0, 2.0, 0.0],
            "estimate": [9.0, 0.3, 2.0, -0.4],
            "prior_sd": [9.0, 0.1, 1.0, 0.1],
        }
    )
    assert measured_trials.farthest(bsp) == "com_x of b -4.0"


@pytest.mark.slow
@pytest.mark.measured
def test_page_of_measured_trials(fit_of):
    runs = {
        name: {**fit_of(name).summary, "bsp": pd.read_csv(fit_of(name).folder / "bsp.csv")}
        for name in ("gait2354", "pig_a")
    }
    page = measured_trials.document(runs)
    for name, run in runs.items():
        trial = run["trials"][0]
        residual = trial["residual_force_rms_N"]["estimate"], trial["residual_force_max_N"]["estimate"]
        title = measured_trials.WALKS[name]
        assert re.search(rf"\| {title}, force \(N\) .*\| {residual[0]:.1f} \({residual[1]:.1f}\) \|", page)
        assert re.search(rf"\| {title} \| {trial['n_frames']} \| {trial['n_dynamic_frames']} \|", page)
        for finding in run["findings"]:
            told = (
                finding["severity"] in ("WARNING", "ERROR")
                and finding["status"] == "open"
                and finding["muted_by"] is None
            )
            assert (f"{finding['code']} {finding['message']}" in page) == told


@pytest.mark.slow
def test_page_of_speed(measured_folder, tmp_path, monkeypatch):
    speed = pytest.importorskip("validation.speed")
    monkeypatch.setattr(speed, "WINDOW_S", {"gait2354": (0.0, 0.6)})
    monkeypatch.setattr(speed, "ESTIMATED_S", (0.8,))
    monkeypatch.setattr(speed, "command_section", lambda runs: "")
    monkeypatch.setattr(speed, "first_run_section", lambda: "")
    page = speed.document(runs=1, lengths=(1, 2), names=("gait2354",))
    for stage in speed.STAGES:
        (once, twice, growth) = re.search(
            rf"\| {stage}, gait2354 walk \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", page
        ).groups()
        assert min(float(once), float(twice), float(growth)) >= 0
    assert re.search(r"\| inverse kinematics, gait2354 walk \| [\d.]+ \| [\d.]+ \| \d+ \|", page)
    assert re.search(r"\| 1 s \| 81 \| \d+ \|", page)
    assert re.search(r"\| \*\*root load, derivatives and regressor\*\* \| [\d.]+ \| [\d.]+ \| [\d.]+ \|", page)


def test_a_process_is_timed_whole_and_may_not_fail():
    clock, processor = command_speed.spent([sys.executable, "-c", "import time; time.sleep(0.3)"])
    assert clock > 0.3
    assert 0.0 < processor < clock
    with pytest.raises(subprocess.CalledProcessError):
        command_speed.spent([sys.executable, "-c", "raise SystemExit(1)"])


def test_a_process_of_another_checkout_runs_its_package(tmp_path):
    package = tmp_path / "src" / "kinertia"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("before = True\n", encoding="utf-8")
    program = [sys.executable, "-c", "import kinertia; assert kinertia.before"]
    command_speed.spent(program, tmp_path)
    with pytest.raises(subprocess.CalledProcessError):
        command_speed.spent(program)


@pytest.mark.slow
def test_a_minute_takes_little_more_memory_than_a_walk():
    """Its normal equations alone would be 350 MB, and what was made of them some four times as much."""
    pytest.importorskip("resource", reason="no peak of memory on Windows")
    minute = in_own_process(1.0)
    assert minute.frames == 6000
    assert minute.estimate_mb < 650
    assert f"| 1 min | 6000 | 100 | {minute.before_mb:.0f} |" in document([minute])


def field_case(**changes):
    case = field_trials.Case(
        title="lab: walk",
        folder=Path(),
        arguments=("fit", "walk.c3d"),
        truth="right heel beyond plate 2",
        sound=False,
        status=(0,),
        expected=("P282|P281",),
        allowed=("S111",),
        never=("T211",),
        draft=None,
    )
    return replace(case, **changes)


def field_outcome(status, *codes, severity="WARNING", **changes):
    findings = [
        {"code": code, "severity": severity, "status": "open", "muted_by": None, "message": f"{code} said.", **changes}
        for code in codes
    ]
    return field_trials.Outcome(status, 1, 2.0, {"findings": findings})


@pytest.mark.parametrize(
    ("outcome", "against"),
    [
        (field_outcome(0, "P282", "S111", "R301"), ""),
        (field_outcome(2, "P281"), "exit status 2"),
        (field_outcome(0), "P282 or P281 missing"),
        (field_outcome(0, "P282", "P223"), "P223 is false"),
        (field_outcome(0, "P282", "T211", severity="CORRECTED"), "T211 is false"),
        (field_outcome(0, "P282", "P223", severity="CORRECTED"), ""),
        (field_outcome(0, "P282", "R305"), "an impossible pose"),
        (field_outcome(0, "P282", muted_by="P281"), "P282 or P281 missing"),
    ],
)
def test_what_is_not_as_it_should_be_of_a_field_trial(outcome, against):
    assert field_case().against(outcome) == against


def test_page_of_field_trials():
    good, bad = (field_case(), field_outcome(0, "P282")), (field_case(title="lab: jump"), field_outcome(2, "T101"))
    page = field_trials.document([good, bad])
    assert "1 of 2 are as they\nshould be" in page
    assert "| lab: walk | right heel beyond plate 2 | yes | 0 | refused | 1 | P282 | - | 2 |" in page
    assert "| lab: jump | right heel beyond plate 2 | no: exit status 2, P282 or P281 missing, T101 is false |" in page
    assert "- lab: jump: T101 T101 said." in page


def test_verdicts_on_sound_recordings_and_on_others():
    said = {"suitability": [{"output": "motion", "use": "do not use"}, {"output": "joint moments", "use": "use"}]}
    used = replace(field_outcome(0), content={"findings": [], **said})
    outcomes = [
        (field_case(sound=sound), outcome) for sound in (True, False, None) for outcome in (used, field_outcome(2))
    ]
    found = field_trials.verdicts([*outcomes, (field_case(), field_outcome(2))])
    assert "| nothing known that concerns joint moments | 1 of 2 | 0 of 2 | 0 of 2 | 1 of 2 |" in found
    assert "| a fault that concerns them | 1 of 3 | 0 of 3 | 0 of 3 | 2 of 3 |" in found


def test_every_field_case_has_its_files(measured_folder):
    every = list(field_trials.cases(measured_folder))
    assert len({case.title for case in every}) == len(every) >= 48
    for case in every:
        files = [Path(word) for word in case.arguments if word.endswith(field_trials.FILES)]
        assert files
        assert all(file.is_file() for file in files)


def test_page_of_cohorts_says_what_was_measured():
    runs = [cohort_speed.Run(50, 90.0, 1000.0, 990.0), cohort_speed.Run(200, 330.0, 1010.0, 1005.0)]
    text = cohort_speed.document(cohort_speed.Singles([3.0] * 20, [3.2] * 20), runs, 2)
    assert "| 200 | 330 | 1.65 | 1010 | 1005 |" in text
    assert "takes 1.10 times that (within 1.15)" in text
    assert "takes 1.03 times (within 1.15)" in text
    assert "goes from\n  1000 to 1010 MB" in text
    assert "24 million frames" in text
