"""Where measured recordings are: none are part of the repository.

They are looked for in the folder that the environment variable KINERTIA_DATA names. If it names none, they are looked
for in `shared/data` beside the repository and in the cache of `kinertia demo --measured`, which holds the gait2354 walk
only.
"""

import os
from functools import cache
from pathlib import Path

from kinertia.io.samples import VARIABLE, samples_folder

FOLDERS = ("gait2354", "pig_c3d", "rajagopal_walk", "subject4")
"""Folders of the people that most pages need."""
BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"


@cache
def places() -> tuple[Path, ...]:
    """Return the folders that exist, best first; cached, since tests change the environment."""
    stated = os.environ.get(VARIABLE)
    folders = [Path(stated)] if stated else [BESIDE, samples_folder()]
    return tuple(folder for folder in folders if folder.is_dir())


def find(name: str) -> Path | None:
    """Find the file or folder of this name (`gait2354/subject01_walk1.trc`) in the first place that has it."""
    return next((folder / name for folder in places() if (folder / name).exists()), None)


def data_folder() -> Path:
    """Return the first place that holds all of FOLDERS.

    Raises:
        FileNotFoundError: there is no such place.
    """
    for folder in places():
        if all((folder / name).is_dir() for name in FOLDERS):
            return folder
    raise FileNotFoundError(f"no measured recordings: {VARIABLE} names none, and there are none in {BESIDE}")
