"""A process that hangs in compiled code is ended, and its log tells the next one."""

import os
import subprocess
import sys

from kinertia.cohort.time_limit import no_end, time_limit, was_ended

HANGS = """
    import re, sys
    from pathlib import Path
    from kinertia.cohort.time_limit import time_limit
    with time_limit(0.2, Path(sys.argv[1]), "this"):
        re.match("(a+)+b", "a" * 60)
"""


def test_what_hangs_is_ended_and_known_in_this_run_only(tmp_path):
    log = tmp_path / "Ben.log"
    code = "\n".join(line.strip() if "re.match" not in line else "    " + line.strip() for line in HANGS.splitlines())
    path = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code, log], env=path, timeout=60)
    assert done.returncode == 1
    assert was_ended(log, "this")
    assert not was_ended(log, "the next")
    assert str(log) in no_end(900.0, log)


def test_what_ends_leaves_nothing(tmp_path):
    log = tmp_path / "Anna.log"
    with time_limit(60.0, log, "this"):
        assert not was_ended(log, "this")
    assert not log.exists()
    assert not was_ended(log, "this")
