"""A real SLURM on this one machine, as Debian's slurm-wlm has it: everything in a folder of its own, gone afterwards.

    python tests/slurm_here.py FOLDER COMMAND ...

runs a command with it.
"""

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "sinfo")
CONFIGURATION = """\
ClusterName=kinertia
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={control_port}
SlurmdPort={node_port}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={munge_socket}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_min_interval=0
MpiDefault=none
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory_mb} State=UNKNOWN
PartitionName=here Nodes={host} Default=YES State=UP
"""
_PATIENCE_S = 60.0


def lacking() -> str:
    """Why there is none here; empty where there can be one."""
    places = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin"])
    missing = [name for name in PROGRAMS if shutil.which(name, path=places) is None]
    if missing:
        return f"needs SLURM ({', '.join(missing)} not there): apt-get install slurm-wlm"
    return "" if os.geteuid() == 0 else "needs root: SLURM's daemons start jobs in other users' names"


@contextmanager
def slurm_here(folder: Path) -> Iterator[dict[str, str]]:
    """The environment in which `sbatch` finds it."""
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    munge_socket = Path(tempfile.mkdtemp(), "munge")  # whose path has 108 bytes at most
    munge_socket.parent.chmod(0o755)
    host = socket.gethostname().split(".")[0]
    control_port, node_port = _free_ports(2)
    text = CONFIGURATION.format(
        host=host,
        folder=folder,
        munge_socket=munge_socket,
        control_port=control_port,
        node_port=node_port,
        cores=psutil.cpu_count(),
        memory_mb=psutil.virtual_memory().total // 2**20,
    )
    (folder / "slurm.conf").write_text(text, encoding="utf-8")
    key = folder / "munge.key"
    key.write_bytes(os.urandom(128))
    key.chmod(0o600)
    folder.chmod(0o755)
    environment = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf")}
    environment["PATH"] = os.pathsep.join([environment.get("PATH", ""), "/usr/sbin"])
    munge = ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={munge_socket}"]
    munge += [f"--{name}-file={folder}/munged.{name}" for name in ("pid", "log", "seed")]
    daemons = []
    try:
        for command in (munge, ["slurmctld", "-D", "-c"], ["slurmd", "-D", "-c", "-N", host]):
            with (folder / f"{command[0]}.out").open("w", encoding="utf-8") as log:
                daemons.append(subprocess.Popen(command, env=environment, stdout=log, stderr=log))
            if command is munge:
                _wait(munge_socket.exists, folder)
        ask = ["sinfo", "--noheader", "--format=%t"]
        idle = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True, "env": environment}
        _wait(lambda: "idle" in subprocess.run(ask, **idle).stdout, folder)
        yield environment
    finally:
        for daemon in reversed(daemons):
            with contextlib.suppress(psutil.NoSuchProcess):
                for child in psutil.Process(daemon.pid).children(recursive=True):
                    child.kill()
            daemon.kill()
            daemon.wait()
        shutil.rmtree(munge_socket.parent)


def _free_ports(count: int) -> list[int]:
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(count)]
        return [bound.getsockname()[1] for bound in held]


def _wait(ready, folder: Path) -> None:
    until = time.monotonic() + _PATIENCE_S
    while not ready():
        if time.monotonic() > until:
            logs = [f"{path.name}: {path.read_text(errors='replace')[-500:]}" for path in sorted(folder.glob("*.out"))]
            raise TimeoutError(f"SLURM does not start: {logs}")
        time.sleep(0.1)


if __name__ == "__main__":
    with slurm_here(Path(sys.argv[1]).resolve()) as found:
        raise SystemExit(subprocess.run(sys.argv[2:], env=found).returncode)
