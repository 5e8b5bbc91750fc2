"""A process that answers in lines of JSON: other output, its log, and questions to one that has ended."""

import sys

from kinertia.cohort.local import Process


def test_other_output_is_passed_over():
    program = "print('ezc3d says hello'); print('[1]'); print('{\"stage\": \"x\", \"share\": 1.0}')"
    with Process([sys.executable, "-c", program]) as process:
        assert list(process.answers()) == [{"stage": "x", "share": 1.0}]


def test_errors_are_in_the_log_and_in_the_status():
    with Process([sys.executable, "-c", "import sys; print('why', file=sys.stderr); sys.exit(3)"]) as process:
        assert list(process.answers()) == []
        assert (process.status(), process.log.strip()) == (3, "why")
        process.ask("anything")
