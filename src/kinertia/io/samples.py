"""The sample walk: OpenSim's gait2354 example, downloaded once with pooch.

A measured static trial, a walk, its ground reactions and an ExternalLoads file, from
https://github.com/opensim-org/opensim-models (Apache License 2.0) at one commit, so that everyone has the same bytes.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from urllib.parse import urlsplit

import platformdirs

from kinertia.errors import KinertiaError

URL = (
    "https://raw.githubusercontent.com/opensim-org/opensim-models/"
    "20a888b9655e73fb84963d6e03eee3752cf6074b/Pipelines/Gait2354_Simbody/"
)
SHA256: Mapping[str, str] = MappingProxyType(
    {
        "subject01_static.trc": "8e55e20f0f468df98429c895a094135316adba3e9b475a75096a91da18c5bdf7",
        "subject01_walk1.trc": "b7ff1d0fee39a6b035f898b38c55d4f58ac3c941be5f83c3b4849e9bc5f9aad4",
        "subject01_walk1_grf.mot": "c3b5b46c64e958832f402687c328ca0f6fe132ebd8ccdf613600c5422d4a2a81",
        "subject01_walk1_grf.xml": "49158c0ab39a7692ed99144a12b369aa9573805c9431cdfe9e6c268fc67f89ab",
    }
)
"""The files, and the SHA-256 of each."""
NAME, SIZE_MB = "gait2354", 0.9
"""Of their folder, and of all four."""
VARIABLE = "KINERTIA_DATA"
"""Environment variable: a folder that holds the folder `NAME`, in place of the user's cache."""
_TIMEOUT_S = 20
_HOW = 'pip install "kinertia[samples]"'


def samples_folder() -> Path:
    """Where samples are kept: what the environment variable names, or the user's cache; it need not exist."""
    stated = os.environ.get(VARIABLE)
    return Path(stated) if stated else platformdirs.user_cache_path("kinertia", appauthor=False)


def sample_walk(progress: Callable[[str, float], None] = lambda stage, share: None) -> Path:
    """The folder of the sample walk; what is not in it yet is downloaded.

    Args:
        progress: takes the stage's name and its share done.

    Raises:
        KinertiaError: a file is neither there nor to be had; it says which files to put where by hand.
    """
    folder = samples_folder() / NAME
    missing = [name for name, expected in SHA256.items() if _sha256(folder / name) != expected]
    if missing and find_spec("pooch") is None:
        raise _unavailable(folder, missing, "pooch, which downloads it, is not installed", f"install it ({_HOW})")
    for k, name in enumerate(missing):
        share = _Share(partial(_of_all, progress, k, len(missing)))
        if problem := _downloaded(name, folder, share):
            raise _unavailable(folder, missing[k:], problem, "name a proxy in HTTPS_PROXY")
    return folder


def _of_all(progress: Callable[[str, float], None], k: int, count: int, share: float) -> None:
    progress("downloading", (k + share) / count)


def _sha256(path: Path) -> str:
    """Of a file; empty where there is none to read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def _downloaded(name: str, folder: Path, share: _Share) -> str:
    """Download a file; why not, where that fails."""
    import pooch
    import requests

    server = urlsplit(URL).netloc
    pooch.get_logger().setLevel("WARNING")  # it announces every file otherwise
    one = pooch.create(folder, URL, registry={name: f"sha256:{SHA256[name]}"})
    try:
        one.fetch(name, downloader=pooch.HTTPDownloader(progressbar=share, timeout=_TIMEOUT_S))
    except requests.Timeout:
        return f"{server} did not answer within {_TIMEOUT_S} s"
    except requests.HTTPError as error:
        return f"{server} answered {'' if error.response is None else error.response.status_code} for {name}"
    except requests.RequestException:
        return f"there is no connection to {server}"
    except ValueError:
        return f"what {server} sent as {name} is not the expected file (by its SHA-256)"
    except OSError as error:
        return f"{error.filename or folder} cannot be written: {error.strerror or error}"
    return ""


def _unavailable(folder: Path, names: Iterable[str], problem: str, instead: str) -> KinertiaError:
    return KinertiaError(
        f"the sample walk is not available: {problem}; {instead}, or download {', '.join(names)} from {URL} yourself "
        f"and put them into {folder}"
    )


class _Share:
    """What pooch takes for a progress bar: bytes of one file."""

    def __init__(self, progress: Callable[[float], None]) -> None:
        self._progress, self._done, self.total = progress, 0, 0

    def update(self, count: int) -> None:
        """So many more have come."""
        self._done += count
        self._progress(min(self._done / self.total, 1.0) if self.total else 0.0)

    def reset(self) -> None:
        """From the beginning."""
        self._done = 0

    def close(self) -> None:
        """Nothing is open."""
