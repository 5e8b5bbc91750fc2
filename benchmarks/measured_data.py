"""Where measured recordings are: none are part of the repository.

Looked for in three places, in this order: the folder that the environment variable KINERTIA_DATA names, `shared/data`
beside the repository, and the cache of `kinertia demo --measured`, which holds the gait2354 walk only.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

from kinertia.io.samples import VARIABLE, samples_folder

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"


@cache
def places() -> tuple[Path, ...]:
    """The folders that exist, best first; looked for once, since tests change the environment."""
    stated = os.environ.get(VARIABLE)
    folders = [*([Path(stated)] if stated else []), BESIDE, samples_folder()]
    return tuple(folder for folder in folders if folder.is_dir())


def find(name: str) -> Path | None:
    """The file or folder of this name (`gait2354/subject01_walk1.trc`) in the first place that has it."""
    return next((folder / name for folder in places() if (folder / name).exists()), None)


def data_folder() -> Path:
    """The first of the places.

    Raises:
        FileNotFoundError: there is none.
    """
    for folder in places():
        return folder
    raise FileNotFoundError(f"no measured recordings: {VARIABLE} is not set, and there is no {BESIDE}")
