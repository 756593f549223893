"""A Slurm of our own on the loopback device: one controller, two virtual nodes, no system service.

Everything lives in a temporary folder, with its own munge key and sockets; nothing outside is read
or written, and every process that was started is ended by its id.
"""

import contextlib
import getpass
import os
import shutil
import site
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

from launch import environment

DAEMONS = ("munged", "slurmctld", "slurmd", "sbatch")
WAIT = 180.0
"""Seconds after which a state of a job that should come counts as never coming."""

Parameters = Mapping[str, object] | None

FINAL = {"COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL", "OUT_OF_MEMORY"}

CONFIGURATION = """\
ClusterName=asperity
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
# Credentials that live long would make a requeued job wait as long.
AuthInfo=socket={folder}/munge.sock,cred_expire=5
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
TmpFS={folder}/tmp/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
MailProg=/bin/true
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=pmi2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1,bf_interval=1,sched_min_interval=0,batch_sched_delay=0
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=5
MinJobAge=3600
NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[1]} CPUs=4 RealMemory=4000
NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[2]} CPUs=4 RealMemory=4000
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def missing() -> list[str]:
    """Those of Slurm's programs that this machine lacks."""
    return [daemon for daemon in DAEMONS if shutil.which(daemon, path=_path()) is None]


class Cluster:
    """A running Slurm.

    Parameters
    ----------
    folder : an empty folder with a short name: sockets bear no more than 107 characters
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._processes: list[subprocess.Popen[bytes]] = []
        self._environment = environment() | {
            "PATH": _path(),
            "SLURM_CONF": str(folder / "slurm.conf"),
        }

    def __enter__(self) -> Self:
        """Start the daemons and wait for two idle nodes."""
        try:
            self._start()
        except BaseException:
            self._stop()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Cancel what runs and end the daemons."""
        self._stop()

    def sbatch(
        self, *arguments: object, folder: Path, parameters: Parameters = None
    ) -> str:
        """Submit a job from a folder, with parameters in the environment; return its number."""
        return self.ask(
            "sbatch", "--parsable", *arguments, folder=folder, parameters=parameters
        )

    def ask(
        self, *command: object, folder: Path | None = None, parameters: Parameters = None
    ) -> str:
        """Run one of Slurm's commands, or a script of them, and return what it prints."""
        done = self._run([str(word) for word in command], folder, parameters)
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout.strip()

    def _run(
        self,
        command: list[str],
        folder: Path | None = None,
        parameters: Parameters = None,
    ) -> "subprocess.CompletedProcess[str]":
        more = {name: str(value) for name, value in (parameters or {}).items()}
        settings: dict[str, Any] = {"capture_output": True, "text": True, "timeout": WAIT}
        settings |= {"cwd": folder or self.folder, "env": self._environment | more}
        return subprocess.run(command, **settings, check=False)

    def job(self, number: str) -> dict[str, str]:
        """What `scontrol show job` says about a job, key by key."""
        words = self.ask("scontrol", "--oneliner", "show", "job", number).split()
        return dict(word.split("=", 1) for word in words if "=" in word)

    def wait(self, number: str) -> dict[str, str]:
        """Wait for the end of a job, requeued or not; return what Slurm says about it."""
        self.wait_until(lambda: self.job(number)["JobState"] in FINAL, f"job {number}")
        return self.job(number)

    def wait_until(
        self, condition: Callable[[], bool], what: str, every: float = 0.2
    ) -> None:
        """Wait for something, within limits."""
        limit = time.monotonic() + WAIT
        while not condition():
            if time.monotonic() > limit:
                logs = "".join(
                    path.read_text()[-2000:] for path in self.folder.glob("*.log")
                )
                queue = self._run(["squeue", "--all", "--long"]).stdout
                raise AssertionError(
                    f"waited {WAIT} s in vain for {what}:\n{queue}{logs}"
                )
            time.sleep(every)

    def _start(self) -> None:
        folder = self.folder
        for name in ("state", "spool/n1", "spool/n2", "tmp/n1", "tmp/n2"):
            (folder / name).mkdir(parents=True)
        text = CONFIGURATION.format(
            host=socket.gethostname().partition(".")[0],
            user=getpass.getuser(),
            folder=folder,
            ports=_free_ports(3),
        )
        (folder / "slurm.conf").write_text(text)
        key = folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o600)
        munge = {"key-file": key.name, "socket": "munge.sock", "pid-file": "munge.pid"}
        munge |= {"log-file": "munge.log", "seed-file": "munge.seed"}
        options = [f"--{option}={folder / name}" for option, name in munge.items()]
        self._launch("munged", "--foreground", "--force", *options)
        self.wait_until((folder / "munge.sock").exists, "munged")
        self._launch("slurmctld", "-D", "-c")
        for node in ("n1", "n2"):
            self._launch("slurmd", "-D", "-N", node)
        self.wait_until(self._two_idle_nodes, "two idle nodes")

    def _two_idle_nodes(self) -> bool:
        sinfo = self._run(["sinfo", "--noheader", "--Node", "--format=%T"])
        return sinfo.stdout.split() == ["idle", "idle"]

    def _launch(self, *command: str) -> None:
        log = (self.folder / f"{len(self._processes)}-{command[0]}.log").open("wb")
        with log:
            process = subprocess.Popen(
                command, env=self._environment, cwd=self.folder, stdout=log, stderr=log
            )
        self._processes.append(process)

    def _stop(self) -> None:
        if len(self._processes) == 4:
            self._run(
                ["scancel", "--full", "--signal=KILL", f"--user={getpass.getuser()}"]
            )
        for process in reversed(self._processes):
            process.terminate()
        for process in self._processes:
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(20)
        self._end_leftovers()

    def _end_leftovers(self) -> None:
        """Steps outlive their node's daemon; they and their jobs know this cluster's name."""
        mark = f"SLURM_CONF={self.folder}/slurm.conf".encode()
        for entry in Path("/proc").iterdir():
            try:
                if entry.name.isdecimal() and mark in (
                    entry / "environ"
                ).read_bytes().split(b"\0"):
                    os.kill(int(entry.name), 9)
            except OSError:
                continue


def _path() -> str:
    """Debian keeps daemons where users do not look."""
    return os.pathsep.join([os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"])


def _free_ports(count: int) -> list[int]:
    """Ports that nothing listens on; others may take them, but hardly within a second."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for probe in sockets:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in sockets]


def environment_with_python(folder: Path, script: str) -> Path:
    """An environment whose `python` is a shell script: it crashes or sleeps as a test needs it."""
    python = folder / "stand-in" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(f"#!/bin/bash\n{script}\n")
    python.chmod(0o755)
    return python.parents[1]


def thin_environment(folder: Path, notes: Path) -> Path:
    """A small virtual environment with this one's packages and MPI, which notes where it runs."""
    path = folder / "thin"
    subprocess.run(
        [sys.executable, "-m", "venv", "--without-pip", path], check=True, timeout=60
    )
    (packages,) = path.glob("lib/python*/site-packages")
    lent = "\n".join(
        f"import site; site.addsitedir({name!r})" for name in site.getsitepackages()
    )
    (packages / "lent.pth").write_text(f"{lent}\n")
    (packages / "sitecustomize.py").write_text(
        f"import sys; print(sys.prefix, file=open({str(notes)!r}, 'a'))\n"
    )
    lent_files = ("bin/mpiexec", "bin/hydra_pmi_proxy", "lib/libmpi.so.12", "lib/mpich")
    for name in lent_files:
        source = Path(sys.prefix) / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, path / name)
    return path
