"""A folder that one run at a time works in."""

import os
import subprocess
import sys

import pytest

from kinertia.errors import FileError
from kinertia.io.working_folder import sole_use


def test_a_second_run_is_told_of_the_first_and_may_come_after_it(tmp_path):
    path = tmp_path / "lock"
    with (
        sole_use(path, "the folder"),
        pytest.raises(FileError, match=f"the folder is in use by process {os.getpid()} on "),
        sole_use(path, "the folder"),
    ):
        pass
    with sole_use(path, "the folder"):
        pass


def test_what_a_killed_process_held_is_free(tmp_path):
    path = tmp_path / "lock"
    program = (
        "import sys, time\nfrom pathlib import Path\nfrom kinertia.io.working_folder import sole_use\n"
        "with sole_use(Path(sys.argv[1]), 'it'):\n    print('held', flush=True)\n    time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program, str(path)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(FileError, match=f"in use by process {other.pid} on "), sole_use(path, "it"):
            pass
        other.kill()
    with sole_use(path, "it"):
        assert str(os.getpid()) in path.with_name("lock.holder").read_text()
    assert not path.with_name("lock.holder").exists()
