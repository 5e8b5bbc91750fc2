"""What had another name, or was installed, in the version before."""

import pytest

from command_line import run
from kinertia.cli.commands import as_named_now


@pytest.mark.parametrize("name", ["accuracy", "faults", "populations"])
@pytest.mark.parametrize("options", [(), ("-o", "out"), ("--help",)])
def test_evidence_moved_to_the_repository(name, options):
    outcome = run("study", name, *options)
    assert outcome.status == 2
    (line,) = outcome.err.strip().splitlines()
    assert f"kinertia study {name} moved to the repository: run python -m validation {name} in a clone of it" in line


def test_options_of_before_still_work_and_say_their_names_of_now(tmp_path):
    """In the place of the option that they are called now; with no others is there a notice."""
    (tmp_path / "thesis.tex").write_text("mine")
    old = run("check", tmp_path / "none.trc", "-o", tmp_path, "--force")
    now = run("check", tmp_path / "none.trc", "-o", tmp_path, "--overwrite")
    assert (old.status, now.status) == (2, 2)
    assert "--overwrite" in old.err
    assert "none.trc" in old.err
    assert "none.trc" in now.err
    assert "--overwrite" not in now.err
    assert as_named_now(["fit", "--loads", "x.xml", "--force"]) == ["fit", "--loads", "x.xml", "--overwrite"]
