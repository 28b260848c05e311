"""Recordings on request of a page or radio.

A recorder that runs, `ros2 run cassie_bags record`, begins and ends them by its service. Without
one, the page starts a recorder as a separate process.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from rclpy.node import Node
from std_srvs.srv import SetBool

from cassie_msgs.processes import end_with_parent

_TIMEOUT = 10.0  # s for a recorder to write the end of its bag
# s until the signal is repeated: Python can lose a signal that comes during an import
_AGAIN = 2.5


class RecorderService:
    """Begins and ends recordings of a recorder that runs.

    Args:
        node: Node that calls the service.
        tell: Called with the recorder's answers, on the executor's thread.

    Attributes:
        file: Name of the bag that is being recorded; empty if none is known to be.
    """

    SERVICE = "/recorder/record"

    def __init__(self, node: Node, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._client = node.create_client(SetBool, self.SERVICE)
        self.file = ""

    @property
    def available(self) -> bool:
        """Whether a recorder runs."""
        return bool(self._client.service_is_ready())

    def record(self, wanted: bool) -> None:
        """Ask for the begin or end of a recording."""
        if not self.available:
            self.file = ""
            self._tell("nobody records: ros2 run cassie_bags record --start-paused")
            return
        future = self._client.call_async(SetBool.Request(data=wanted))
        future.add_done_callback(partial(self._answered, wanted))

    def _answered(self, wanted: bool, future: Any) -> None:
        answer = future.result()
        if answer is None:
            return
        message: str = answer.message
        # One that is refused as there is a recording already names that one.
        path = message.removeprefix("recording to ").removesuffix(" is being recorded")
        self.file = Path(path).name if wanted and path != message else ""
        self._tell(message)


class Recorder:
    """Starts and ends a recording, of a recorder that runs or of one started here.

    Args:
        folder: Folder for bags.
        tell: Called with text about a recording's begin and end.
        service: Recorder that runs, if there is one.
    """

    def __init__(self, folder: Path, tell: Callable[[str], None], service: RecorderService) -> None:
        self._folder, self._tell, self._service = folder, tell, service
        self._process: subprocess.Popen[bytes] | None = None
        self._file = Path()
        self._asked: float | None = None  # time of the last request to end
        self._program = _program()

    @property
    def available(self) -> bool:
        """Whether the recorder is installed, or one runs."""
        return self._program is not None or self._service.available

    @property
    def file(self) -> str:
        """Name of the bag that is being recorded; empty if there is none."""
        return self._service.file if self._process is None else self._file.name

    def toggle(self) -> None:
        """Begin a recording, or end the running one."""
        if self._process is not None:
            if self._asked is None:
                self._ask()
        elif self._service.available:
            self._service.record(not self._service.file)
        else:
            self._start()

    def look(self) -> None:
        """Report the end of a recording; repeat a request to end if it had no effect."""
        if self._process is None:
            if self._service.file and not self._service.available:
                self._service.file = ""
                self._tell("the recorder is gone")
            return
        if (status := self._process.poll()) is None:
            if self._asked is not None and time.monotonic() - self._asked > _AGAIN:
                self._ask()
            return
        self._process = None
        if self._asked is not None and status == 0:
            self._tell(f"recorded {self._file}")
        elif self._asked is not None and not self._file.exists():
            self._tell("no recording: it was ended before the recorder had started")
        else:
            self._tell(f"recording ended with status {status}")

    def close(self) -> None:
        """End the running recording; the bag is complete."""
        if self._process is None:
            return
        for _ in range(round(_TIMEOUT / _AGAIN)):
            self._ask()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_AGAIN)
                return

    def _ask(self) -> None:
        """Request the recorder's end, as by Ctrl-C; a recorder that is ending ignores it."""
        assert self._process is not None
        self._process.send_signal(signal.SIGINT)
        self._asked = time.monotonic()

    def _start(self) -> None:
        if self._program is None:
            return
        self._file = self._folder / time.strftime("cassie_%Y-%m-%d_%H-%M-%S.mcap")
        self._asked = None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            command: list[str | Path] = [self._program, "-o", self._file]
            # Ctrl-C in the terminal ends the console only, which then ends the recording.
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                preexec_fn=partial(end_with_parent, os.getpid()),
            )
        except OSError as error:
            self._tell(f"no recording: {error}")
        else:
            self._tell(f"recording {self._file}")


def _program() -> Path | None:
    try:
        program = Path(get_package_prefix("cassie_bags"), "lib", "cassie_bags", "record")
    except PackageNotFoundError:
        return None
    return program if program.exists() else None
