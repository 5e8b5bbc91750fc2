"""What had another name, or was installed, in the version before."""

import pytest

from command_line import run


@pytest.mark.parametrize("name", ["accuracy", "faults", "populations"])
@pytest.mark.parametrize("options", [(), ("-o", "out"), ("--help",)])
def test_evidence_moved_to_the_repository(name, options):
    outcome = run("study", name, *options)
    assert outcome.status == 2
    (line,) = outcome.err.strip().splitlines()
    assert f"kinertia study {name} moved to the repository: run python -m validation {name} in a clone of it" in line
