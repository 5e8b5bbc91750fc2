"""What several workers of one run of the tests need is made by the first, and read by the others.

Several runs of one state of the code, as in `.ci/run`, share it where the environment variable names a folder.
"""

import os
import pickle
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")
SHARED = "KINERTIA_TESTS_SHARE"


def once(tmp_path_factory, name: str, make: Callable[[Path], T]) -> T:
    """What `make` returns for an empty folder, called by one worker only; the others wait. It must be picklable."""
    base = tmp_path_factory.getbasetemp()
    of_run = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder = Path(os.environ.get(SHARED, of_run)) / f"once-{name}"
    done, failed = folder / "done.pickle", folder / "failed"
    try:
        folder.mkdir()
    except FileExistsError:
        while not done.exists():
            assert not failed.exists(), f"could not be made, as a test of another worker says: {name}"
            time.sleep(0.05)
        result: T = pickle.loads(done.read_bytes())
        return result
    try:
        (folder / "made").mkdir()
        result = make(folder / "made")
        (folder / "half.pickle").write_bytes(pickle.dumps(result))
        (folder / "half.pickle").rename(done)
    except BaseException:
        failed.touch()
        raise
    return result
