"""The gait2354 walk whole, cut in two and pooled again, and its section of docs/validation/accuracy.md."""

from dataclasses import replace

import numpy as np

from kinertia.io.recording import read_recording
from kinertia.settings import Settings, Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate_bsp
from kinertia.workflow.person import Person
from validation.measured_data import data_folder
from validation.measured_trials import table


def pooled() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return estimate and SD of every BSP of the gait2354 walk: whole, first half, second half, halves together."""
    folder = data_folder() / "gait2354"
    walked = read_recording(
        folder / "subject01_walk1.trc", folder / "subject01_walk1_grf.mot", folder / "subject01_walk1_grf.xml"
    )
    static = read_recording(folder / "subject01_static.trc")
    subject = Subject(name="gait2354", sex="male", mass_kg=72.6, height_m=1.803)
    settings = Settings(method="simultaneous")
    halves = [TrialInput(replace(walked, name=n), w) for n, w in (("first", (0.0, 1.25)), ("second", (1.25, 2.5)))]
    inputs = {"whole": [TrialInput(walked)], "first half": halves[:1], "second half": halves[1:], "halves": halves}
    fits = {name: estimate_bsp(Person(subject, trials, static), settings).bsp for name, trials in inputs.items()}
    return (
        {name: bsp["estimate"].to_numpy() for name, bsp in fits.items()},
        {name: bsp["sd"].to_numpy() for name, bsp in fits.items()},
    )


def pooling_section(values: dict[str, np.ndarray], sds: dict[str, np.ndarray]) -> str:
    """Describe how far the halves, alone and together, are from the whole, and their certainty."""
    rows = []
    for name in ("first half", "second half", "halves"):
        away = (values[name] - values["whole"]) / sds["whole"]
        ratio = sds[name] / sds["whole"]
        largest = np.abs(away).max()
        rows.append([name, f"{np.sqrt(np.mean(away**2)):.2f}", f"{largest:.2f}", f"{ratio.mean():.3f}"])
    best = np.minimum(sds["first half"], sds["second half"])
    smaller, most = np.mean(sds["halves"] <= best), np.max(sds["halves"] / best) - 1.0
    text = table(["estimate from", "RMS difference", "largest", "sd / sd of the whole, mean"], rows)
    share = f"With both halves, the SD is no larger than with either half alone for {100 * smaller:.0f} % of the BSPs"
    return f"{text}\n\n{share}, and at most {100 * most:.1f} % larger for the others."
