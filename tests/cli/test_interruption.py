"""Commands that are interrupted, or asked to end, leave nothing behind."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest


@pytest.mark.parametrize(
    ("arguments", "stage"),
    [
        pytest.param(
            ["fit", "walk.c3d", "--static", "static.c3d", "--sex", "male"], "calibration", marks=pytest.mark.slow
        ),
        pytest.param(["demo"], "inverse kinematics", marks=pytest.mark.slow),
        pytest.param(["study", "table1", "--repeats", "1"], "1 draws", marks=pytest.mark.slow),
    ],
)
def test_interruption_leaves_nothing(tmp_path, person, arguments, stage):
    """As the shell's Ctrl-C does it: a signal in the middle of the work, once this stage is told."""
    signals = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{signals}\nfrom kinertia.cli.commands import main; main()"
    files = [str(person / word) if word.endswith(".c3d") else word for word in arguments]
    command = [sys.executable, "-c", code, *files, "-o", str(tmp_path / "deep" / "out")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while process.stderr.readline().strip() != stage:
            assert process.poll() is None
        os.kill(process.pid, signal.SIGINT)
        rest = process.stderr.read()
    assert process.returncode == 130
    assert "Traceback" not in rest
    assert not (tmp_path / "deep").exists()
    assert [path.name for path in tmp_path.iterdir()] == [person.name]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no signals")
@pytest.mark.parametrize("name", ["SIGTERM", pytest.param("SIGHUP", marks=pytest.mark.slow)])
def test_the_request_to_end_leaves_nothing(tmp_path, person, name):
    code = """
        import contextlib, os, signal, sys
        from kinertia.cli.commands import main
        from kinertia.report.pages import check_page
        name, made = sys.argv.pop(), check_page.complete_folder
        signal.signal(getattr(signal, name), signal.SIG_DFL)  # nohup ignores it
        @contextlib.contextmanager
        def ended(*arguments):
            with made(*arguments) as work:
                os.kill(os.getpid(), getattr(signal, name))
                yield work
        check_page.complete_folder = ended
        main()
    """
    command = [sys.executable, "-c", textwrap.dedent(code), "check", person / "walk.c3d", "-o", tmp_path / "out", name]
    done = subprocess.run(list(map(str, command)), capture_output=True, check=False)
    assert done.returncode == 128 + getattr(signal, name), done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [person.name]
