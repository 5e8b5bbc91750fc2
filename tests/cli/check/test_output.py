"""What `kinertia check` prints, and the page that it writes."""

import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from checked import facts_of, told
from command_line import run
from kinertia.io.text.trc import write_trc
from report_page import Elements


def text(outcome):
    return " ".join(outcome.out.split())


def test_the_verdict_is_one_line_and_verbose_says_all(lab):
    outcome = run("check", lab / "subject.toml")
    assert outcome.status == 0
    assert re.match(r"Use\. No problems were found; the trial was used\.\n", outcome.out)
    assert outcome.err.splitlines() == ["reading"]
    loud = run("check", lab / "subject.toml", "-v")
    findings = told(lab / "subject.toml")["findings"]
    assert findings
    for finding in findings:
        assert f"{finding['severity']}  " in loud.out
        assert f"{finding['code']} {finding['message']}" in loud.out
    before = loud.out.partition("\nUse. ")[0].splitlines()
    assert max(map(len, before)) <= 80
    for facts in facts_of(told(lab / "subject.toml")).values():
        for name, sentence in facts.items():
            assert f"{name} {sentence}" in text(loud)


def test_gaps_are_listed_when_asked(lab, recordings):
    markers = recordings.walk.markers
    positions = markers.positions.copy()
    positions[:20, markers.labels.index("R.Heel")] = np.nan
    write_trc(lab / "walk.trc", type(markers)(markers.time, markers.labels, positions))
    outcome = run("check", lab / "walk.trc", lab / "walk_grf.mot", "--verbose")
    assert re.search(r"R\.Heel +\d+ +0\.20", outcome.out)
    assert not re.search(r"L\.Heel +100", outcome.out)


def test_quiet_says_it_by_the_status(lab):
    fine = run("check", lab / "walk.trc", lab / "walk_grf.mot", "--quiet")
    assert (fine.status, fine.out, fine.err) == (0, "", "")
    against = run("check", lab / "walk.trc", lab / "walk_grf.mot", "--mass", "90", "-q")
    assert (against.status, against.out, against.err) == (1, "", "")
    mistake = run("check", lab / "no.trc", "-q")
    assert mistake.status == 2
    assert mistake.err.startswith("error: ")
    assert run("check", lab / "walk.trc").out  # the next command speaks again


def test_page_is_one_file_that_needs_nothing_else(lab):
    shutil.move(lab / "walk.trc", lab / "<script>alert(1)</script>.trc".replace("/", ""))
    (spoilt,) = lab.glob("<script>*")
    outcome = run("check", spoilt, lab / "walk_grf.mot", "-o", lab / "out", "--mass", 72.6)
    assert outcome.status == 0
    (written,) = (lab / "out").glob("[!.]*")
    assert written.stat().st_size < 3_000_000
    page = Elements(written.read_text(encoding="utf-8"))
    references = [tag[name] for _, tag in page.tags for name in ("src", "href", "srcset", "data") if name in tag]
    assert [reference for reference in references if not reference.startswith("#")] == []
    assert "<script>alert" not in written.read_text(encoding="utf-8")
    words = " ".join(page.text.split())
    assert "<script>alert(1)<script>" in words
    for phrase in ("walks along +X", "R.Heel", "foot on plate", "2 plates at 1000 Hz"):
        assert phrase in words


def test_page_goes_only_where_it_may(lab):
    (lab / "foreign").mkdir()
    (lab / "foreign" / "thesis.tex").write_text("mine")
    refused = run("check", lab / "static.trc", "-o", lab / "foreign")
    assert refused.status == 2
    assert "--overwrite" in refused.err
    assert [path.name for path in (lab / "foreign").iterdir()] == ["thesis.tex"]
    assert run("check", lab / "static.trc", "-o", lab / "foreign", "--overwrite").status == 0
    assert (lab / "foreign" / "thesis.tex").read_text() == "mine"
    (lab / "foreign" / "thesis.tex").unlink()
    assert run("check", lab / "static.trc", "-o", lab / "foreign").status == 0  # its own is replaced


@pytest.mark.parametrize(("mass", "status"), [("72.6", 0), ("90", 1)])
@pytest.mark.slow
def test_nobody_reads_on(lab, mass, status):
    """As with `| head`: the page is there, and the status is the check's."""
    files = [str(lab / name) for name in ("walk.trc", "walk_grf.mot")]
    command = [sys.executable, "-c", "from kinertia.cli.commands import main; main()", "check", *files, "--mass", mass]
    read, write = os.pipe()
    os.close(read)
    try:
        ended = subprocess.run([*command, "-o", str(lab / "out")], stdout=write, stderr=subprocess.PIPE, text=True)
    finally:
        os.close(write)
    assert (ended.returncode, ended.stderr) == (status, "reading\n")
    assert "complete contact" in (lab / "out" / "check.html").read_text()
