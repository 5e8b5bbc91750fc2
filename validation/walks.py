"""The four measured walks that pages and tests run on, and how to ask for each on the command line."""

from __future__ import annotations

from pathlib import Path

WALKS = {
    "gait2354": "gait2354 walk",
    "rajagopal": "Rajagopal walk",
    "pig_a": "Plug-in Gait, subject A",
    "pig_b": "Plug-in Gait, subject B",
}


def fit_arguments(data: Path, name: str) -> list[str]:
    """Arguments of `kinertia fit` for one of WALKS. Mass and height of subject B come from the C3D file."""
    if name == "gait2354":
        walk, static = data / "gait2354" / "subject01_walk1", data / "gait2354" / "subject01_static.trc"
        files = [f"{walk}.trc", "--forces", f"{walk}_grf.mot", "--loads", f"{walk}_grf.xml", "--static", str(static)]
        return [*files, "--mass", "72.6", "--height", "1.803", "--sex", "male"]
    if name == "rajagopal":
        lab = data / "rajagopal_walk"
        files = [f"{lab}/motion_capture_walk.trc", "--forces", f"{lab}/grf_walk.mot", "--loads", f"{lab}/grf_walk.xml"]
        return [*files, "--static", f"{lab}/static_walk_1.trc", "--mass", "85", "--height", "1.83", "--sex", "male"]
    walk, static = (data / "pig_c3d" / f"subject_{name[-1]}_{kind}.c3d" for kind in ("walk", "static"))
    person = ["--mass", "41.5", "--height", "1.61", "--sex", "male"] if name == "pig_a" else ["--sex", "female"]
    return [str(walk), "--static", str(static), *person]
