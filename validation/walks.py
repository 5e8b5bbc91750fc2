"""The four measured walks that pages and tests run on, and how to ask for each on the command line."""

from pathlib import Path

WALKS = {
    "gait2354": "gait2354 walk",
    "rajagopal": "Rajagopal walk",
    "pig_a": "Plug-in Gait, subject A",
    "pig_b": "Plug-in Gait, subject B",
}


def fit_arguments(data: Path, name: str) -> list[str]:
    """Return the arguments of `kinertia fit` for one of WALKS. Mass and height of subject B come from the C3D file."""
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


_FAULT_FREE = (
    ("Plug-in Gait, subject A", "male", 41.5, 1.61, "pig_c3d", "subject_a_static.c3d", "subject_a_walk.c3d", ""),
    (
        "Gait 2354 walk",
        "male",
        72.6,
        1.803,
        "gait2354",
        "subject01_static.trc",
        "subject01_walk1.trc",
        "subject01_walk1_grf",
    ),
    (
        "Rajagopal walk",
        "male",
        85.0,
        1.83,
        "rajagopal_walk",
        "static_walk_1.trc",
        "motion_capture_walk.trc",
        "grf_walk",
    ),
    ("Plug-in Gait, subject B", "female", 47.5, 1.505, "pig_c3d", "subject_b_static.c3d", "subject_b_walk.c3d", ""),
    ("Rajagopal run", "male", 75.3, 1.75, "field/rajagopal_run", "static_run.trc", "motion_capture_run.trc", "grf_run"),
)
"""Names, sex, mass (kg), stature (m), folder, static trial, walk, and forces where they have files of their own."""


def subject_files(data: Path, folder: Path) -> list[Path]:
    """Write subject files of the measured walks that faults are injected into; names determine the random seed.

    Args:
        data: measured recordings.
        folder: for the files.
    """
    paths = []
    for number, (name, sex, mass_kg, height_m, place, static, walk, forces) in enumerate(_FAULT_FREE):
        lab = data.resolve() / place
        lines = ["[subject]", f'name = "{name}"', f'sex = "{sex}"', f"mass_kg = {mass_kg}", f"height_m = {height_m}"]
        lines += ["[model]", f'static = "{lab / static}"', "[[trial]]", f'markers = "{lab / walk}"']
        if forces:
            lines += [f'forces = "{lab / forces}.mot"', f'loads = "{lab / forces}.xml"']
        paths.append(folder / f"walk{number}.toml")
        paths[-1].write_text("\n".join(lines) + "\n", encoding="utf-8")
    return paths
