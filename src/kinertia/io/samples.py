"""Downloads the sample walk, OpenSim's gait2354 example, once with pooch.

A measured static trial, a walk, its ground reactions and an ExternalLoads file, from
https://github.com/opensim-org/opensim-models (Apache License 2.0) at one commit, so that everyone has the same bytes.
"""

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from urllib.parse import urlsplit

import platformdirs

from kinertia.errors import KinertiaError, how_to_install

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
"""Name of their folder, and size of all four."""
VARIABLE = "KINERTIA_DATA"
"""Environment variable: a folder that holds the folder `NAME`, in place of the user's cache."""
_TIMEOUT_S = 20


def samples_folder() -> Path:
    """Return the samples folder, from the environment variable or in the user's cache; it need not exist."""
    stated = os.environ.get(VARIABLE)
    return Path(stated) if stated else platformdirs.user_cache_path("kinertia", appauthor=False)


def sample_walk(progress: Callable[[str, float], None] = lambda stage, share: None) -> Path:
    """Return the folder of the sample walk; missing files are downloaded.

    Args:
        progress: called with the stage's name and its share done.

    Raises:
        KinertiaError: a file is missing and cannot be downloaded; states which files to put where by hand.
    """
    folder = samples_folder() / NAME
    missing = [name for name, expected in SHA256.items() if _sha256(folder / name) != expected]
    if missing and find_spec("pooch") is None:
        raise _unavailable(
            folder, missing, _Failure("pooch, which downloads it, is not installed", how_to_install("samples"))
        )
    for k, name in enumerate(missing):
        share = _Share(partial(_of_all, progress, k, len(missing)))
        share.report(0.0)
        if failure := _downloaded(name, folder, share):
            raise _unavailable(folder, missing[k:], failure)
        share.report(1.0)
    return folder


def _of_all(progress: Callable[[str, float], None], k: int, count: int, share: float) -> None:
    progress("downloading", (k + share) / count)


def _sha256(path: Path) -> str:
    """Return the SHA-256 of a file; empty where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


class _Failure(NamedTuple):
    """Why a file is missing, and what may help besides downloading it by hand."""

    problem: str
    instead: str


def _downloaded(name: str, folder: Path, share: "_Share") -> _Failure | None:
    """Download a file; return the reason where that fails."""
    import pooch
    import requests

    server = urlsplit(URL).netloc
    pooch.get_logger().setLevel("WARNING")  # it announces every file otherwise
    try:
        registry = pooch.create(folder, URL, registry={name: f"sha256:{SHA256[name]}"})
        registry.fetch(name, downloader=pooch.HTTPDownloader(progressbar=share, timeout=_TIMEOUT_S))
    except requests.HTTPError as error:
        status = "" if error.response is None else error.response.status_code
        return _Failure(f"{server} answered {status} for {name}", "try again later")
    except requests.RequestException as error:
        return _no_answer(server, error)
    except ValueError:
        problem = f"what {server} sent as {name} is not the expected file (by its SHA-256)"
        return _Failure(problem, "log in to your network in a browser if it asks for that, and try again")
    except OSError as error:
        reason = error.__cause__ if isinstance(error.__cause__, OSError) else error  # pooch adds words of its own
        problem = f"{reason.filename or folder} cannot be written: {reason.strerror or reason}"
        return _Failure(problem, f"name another folder in the environment variable {VARIABLE}")
    return None


def _no_answer(server: str, error: Exception) -> _Failure:
    """Describe why nothing, or not everything, came from the server."""
    import requests
    from urllib3.exceptions import ReadTimeoutError

    if isinstance(error, requests.exceptions.SSLError):
        reason = getattr(error.args[0], "reason", error) if error.args else error
        problem = f"no encrypted connection to {server} is possible ({reason})"
        return _Failure(problem, "name the file of your network's certificates in REQUESTS_CA_BUNDLE")
    if isinstance(error, requests.exceptions.ProxyError):
        problem = f"there is no connection to {server} through the proxy that the environment names"
        return _Failure(problem, "correct HTTPS_PROXY")
    if isinstance(error, requests.exceptions.ChunkedEncodingError):
        return _Failure(f"the connection to {server} broke off", "try again")
    hangs = isinstance(error, requests.Timeout) or any(isinstance(cause, ReadTimeoutError) for cause in error.args)
    problem = f"{server} did not answer within {_TIMEOUT_S} s" if hangs else f"there is no connection to {server}"
    return _Failure(problem, "if your network has a proxy, name it in HTTPS_PROXY")


def _unavailable(folder: Path, names: Iterable[str], failure: _Failure) -> KinertiaError:
    others = [name for name in names if os.path.lexists(folder / name)]
    wanted = ", ".join(f"{name} (the one that is there is another)" if name in others else name for name in names)
    return KinertiaError(
        f"the sample walk is not available: {failure.problem}; {failure.instead}, or download {wanted} from {URL} "
        f"yourself and put them into {folder}"
    )


class _Share:
    """Progress of one file in bytes, as the progress bar that pooch expects."""

    def __init__(self, progress: Callable[[float], None]) -> None:
        self._progress, self._done, self.total = progress, 0, 0

    def report(self, share: float) -> None:
        """Report the share of the file received, from 0 to 1."""
        self._progress(share)

    def update(self, count: int) -> None:
        """Count this many more bytes as received."""
        self._done += count
        self.report(min(self._done / self.total, 1.0) if self.total else 0.0)

    def reset(self) -> None:
        """Restart from zero."""
        self._done = 0

    def close(self) -> None:
        """Do nothing: nothing is open."""
