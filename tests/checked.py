"""What `kinertia check` gives to scripts, and the text of its page."""

import json

from command_line import run
from report_page import Elements


def told(*arguments, status=0):
    """What the command gives to scripts."""
    outcome = run("check", *arguments, "--json")
    assert outcome.status == status or status is None, outcome.err
    return json.loads(outcome.out)


def facts_of(content):
    return {recording["name"]: recording["facts"] for recording in content["recordings"]}


def text_of_page(path):
    return " ".join(Elements(path.read_text(encoding="utf-8")).text.split())
