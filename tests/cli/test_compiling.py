"""Compiling once: everything that a fit runs, of the types that it runs, shared among processes."""

import subprocess
import sys

import pytest

from kinertia.cli import compiling
from kinertia.motion import workload

_ESTIMATE = """
from kinertia.cli.compiling import stored_functions
from kinertia.model.compiled import argument_types
from kinertia.studies.sensitivity import Scenario, estimate_person
from kinertia.synthetic.motions import Faults

estimate_person(0, (Scenario("", Faults("artefact"), walk_s=0.5), 0))
used = [one for one in stored_functions() if one.signatures]
assert len(used) > 15, used
for one in used:
    known = {str(types) for types in argument_types(one.py_func)}
    others = {str(types) for types in one.signatures} - known
    assert not others, (one, others, known)
"""


@pytest.mark.slow
def test_what_is_compiled_beforehand_is_what_an_estimate_takes():
    """Of other types than those of the annotations, a function would be compiled twice."""
    done = subprocess.run([sys.executable, "-c", _ESTIMATE], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("count", [1, 2, 3, 8, 40])
def test_every_function_is_in_one_share(count):
    functions = compiling.stored_functions()
    shares = compiling.shares(functions, count)
    assert len(shares) == count
    assert sorted(function.__name__ for share in shares for function in share) == sorted(
        function.__name__ for function in functions
    )
    # what two functions call is compiled once where both are in one share
    assert sum(compiling._length(*share) for share in shares) >= compiling._length(*functions)
    if count == 2:
        assert max(compiling._length(*share) for share in shares) < 0.53 * compiling._length(*functions)


def test_all_is_compiled_where_no_process_can_be_started(monkeypatch):
    """The last step takes what the others have left."""
    ran, told = [], []
    monkeypatch.setattr(compiling, "is_compiled", lambda: False)
    monkeypatch.setattr(compiling, "set_compiled", lambda: ran.append("complete"))
    monkeypatch.setattr(workload, "cores", lambda: 2)
    monkeypatch.setattr(compiling, "_compiled", lambda functions: ran.append(len(functions)) or iter((0.5,)))
    monkeypatch.setattr(compiling, "PYTHON", ("/nowhere/python",))
    compiling.compile_once(lambda stage, share: told.append(share))
    everything = len(compiling.stored_functions())
    assert ran == [len(compiling.shares(compiling.stored_functions(), 2)[0]), everything, "complete"]
    assert told == [0.0, 0.5, 1.0]
