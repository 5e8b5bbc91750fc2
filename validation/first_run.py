"""Measures the first run on a machine, from nothing compiled, and where its time goes.

A copy of the package without anything compiled runs the demo twice. Processor time counts all processes; it travels
to another machine better than the clock, which depends on how many cores are free.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import kinertia
from validation.command_speed import spent
from validation.measured_trials import table

_SHOWN = 12
_PROGRAM = """
import gc, json, sys, time
from collections import defaultdict
from numba.core import event
from kinertia.cli.compiling import stored_functions
from kinertia.model.compiled import argument_types

class Own(event.Listener):
    def __init__(self, name):
        self.name, self.open, self.seconds = name, [], defaultdict(float)
    def on_start(self, one):
        self.open.append([time.process_time(), 0.0])
    def on_end(self, one):
        started, inner = self.open.pop()
        spent = time.process_time() - started
        if self.open:
            self.open[-1][1] += spent
        self.seconds[self.name(one.data)] += spent - inner

def named(data):
    python = data["dispatcher"].py_func
    package, _, rest = python.__module__.partition(".")
    return f"{rest.rpartition('.')[2]}.{python.__name__}" if package == "kinertia" else "NumPy's and Python's own"

functions, steps = Own(named), Own(lambda data: data["name"])
event.register("numba:compile", functions)
event.register("numba:run_pass", steps)
gc.disable()
for one in stored_functions():
    for types in argument_types(one.py_func):
        one.compile(types)
print(json.dumps([functions.seconds, steps.seconds]))
"""


def first_run_section() -> str:
    """Return the section on the first run: both runs of the demo, and what compiling spends its time on."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(kinertia.__file__).parent
        copy = Path(folder) / "src" / "kinertia"
        shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
        command = [sys.executable, "-m", "kinertia", "demo", "--quiet", "--overwrite", "-o", f"{folder}/out"]
        runs = [
            [name, *(f"{seconds:.1f}" for seconds in spent(command, Path(folder)))]
            for name in ("the first time", "the second time")
        ]
        shutil.rmtree(copy / "model" / "__pycache__")
        environment = {**os.environ, "PYTHONPATH": str(copy.parent), "NUMBA_OPT": "1"}
        answer = subprocess.run([sys.executable, "-c", _PROGRAM], env=environment, capture_output=True, check=True)
        functions, steps = json.loads(answer.stdout)
    return "\n\n".join(
        [
            table(["`kinertia demo`", "clock (s)", "processor time (s)"], runs),
            "Processor time of compiling everything in one process, without what a function calls:",
            table(["function", "seconds", "share (%)"], _rows(functions)),
            "The same by Numba's steps; lowering includes LLVM, which optimises each function and writes machine code:",
            table(["step", "seconds", "share (%)"], _rows(steps)),
        ]
    )


def _rows(seconds: dict[str, float]) -> list[list[str]]:
    """Return the largest entries, and the sum of the others."""
    total, largest = sum(seconds.values()), sorted(seconds.items(), key=lambda item: -item[1])
    rows = [*largest[:_SHOWN], ("all others", sum(spent for _, spent in largest[_SHOWN:]))]
    return [[name, f"{spent:.2f}", f"{100 * spent / total:.0f}"] for name, spent in rows]
