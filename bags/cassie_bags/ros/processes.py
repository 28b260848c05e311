"""Nodes as processes of a run: they are found, started with parameters, watched and ended."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from cassie_bags.errors import RunError
from cassie_msgs.processes import end_with_parent
from cassie_msgs.ros.claim import SecondNodeError, run_domain
from cassie_msgs.ros.process import own_arguments

GRACE = 5.0
"""Wall time that a process has to end after Ctrl-C; then it is terminated. In s."""


def executable(package: str, name: str) -> Path:
    """Program of a package, through the ament index.

    Raises:
        RunError: if it is not installed.
    """
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    for prefix in filter(None, prefixes):
        path = Path(prefix) / "lib" / package / name
        if path.is_file():
            return path
    raise RunError(f"{package} {name} is not installed: run make build, then source env.sh")


def words_without_ros(name: str) -> list[str]:
    """Words of this process's command line, without those of ROS; `name` is for its errors."""
    return own_arguments(name)


@contextlib.contextmanager
def own_domain() -> Iterator[int]:
    """A ROS domain that no other run on this machine uses at the same time.

    Raises:
        RunError: if all domains are used.
    """
    try:
        with run_domain() as domain:
            yield domain
    except SecondNodeError as error:
        raise RunError(str(error)) from None


def environment(domain: int) -> dict[str, str]:
    """Environment of the nodes of one run: a domain of their own on this machine only."""
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTHONUNBUFFERED": "1",
    }


def write_parameters(path: Path, parameters: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Write ROS parameters by node to a file; returns the arguments that make a node read it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {node: {"ros__parameters": dict(own)} for node, own in parameters.items()}
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return ["--ros-args", "--params-file", str(path)]


class Processes:
    """The processes of one run. The end of the `with` statement ends them all."""

    def __init__(self, env: Mapping[str, str], logs: Path) -> None:
        """Start nothing yet; `logs` is a folder, with a file for the output of each process."""
        self._env = dict(env)
        self._logs = logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        logs.mkdir(parents=True, exist_ok=True)

    def start(
        self, name: str, command: Sequence[str | Path], processors: Collection[int] = ()
    ) -> None:
        """Start a process, in a session of its own so that it gets Ctrl-C only from us.

        Args:
            name: Name of the process and of its log.
            command: Program and arguments.
            processors: Processors on which it may run; any if empty.
        """

        # Python loses a Ctrl-C that comes while it forks, and the process would not be known yet.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
        parent = os.getpid()

        def prepare() -> None:
            end_with_parent(parent)
            if processors:
                os.sched_setaffinity(0, processors)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

        try:
            with self.log(name).open("wb") as log:
                self._running[name] = subprocess.Popen(
                    [str(word) for word in command],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=self._env,
                    start_new_session=True,
                    preexec_fn=prepare,
                )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def log(self, name: str) -> Path:
        """File with the output of a process."""
        return self._logs / f"{name}.log"

    def printed(self, name: str, text: str) -> bool:
        """Whether a process has printed a text."""
        return text.encode() in self.log(name).read_bytes()

    def running(self, name: str) -> bool:
        """Whether a process still runs."""
        return self._running[name].poll() is None

    def pid(self, name: str) -> int:
        """Process id of a process."""
        return self._running[name].pid

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a process."""
        os.killpg(self._running[name].pid, number)

    def check(self, *may_end: str) -> None:
        """Check that all processes run; some may have ended with exit code 0.

        Raises:
            RunError: naming a process that ended, its exit code and its last line of output.
        """
        for name, process in self._running.items():
            code = process.poll()
            if code is None or (code == 0 and name in may_end):
                continue
            if code < 0:
                raise RunError(f"{name} was ended by {signal.Signals(-code).name}")
            raise RunError(f"{name} ended with exit code {code}: {self._last_line(name)}")

    def stop(self, *names: str) -> None:
        """End processes, or all, with Ctrl-C; then terminate and kill those that do not end."""
        chosen = {name: self._running[name] for name in names or tuple(self._running)}
        for number, timeout in (
            (signal.SIGINT, GRACE),
            (signal.SIGTERM, 1.0),
            (signal.SIGKILL, GRACE),
        ):
            alive = [process for process in chosen.values() if process.poll() is None]
            deadline = time.monotonic() + timeout
            for process in alive:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, number)
            for process in alive:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(max(0.0, deadline - time.monotonic()))

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _last_line(self, name: str) -> str:
        lines = self.log(name).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return lines[-1] if lines else "it printed nothing"
