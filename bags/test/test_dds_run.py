"""Where the nodes of a run may be: apart on two processors, anywhere else on more."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from cassie_bags.ros.dds_run import processors_of
from cassie_bags.ros.processes import Processes, own_domain
from cassie_sim.simulator_config import SimulatorConfig


def test_on_two_processors_the_physics_has_one_and_the_chain_the_other():
    places = processors_of(SimulatorConfig(max_rate=0.0), {3, 5})
    assert places["simulator"] == {3}
    assert places["state_estimator"] == places["gait_controller"] == {5}
    assert set(places) == {"simulator", "state_estimator", "gait_controller"}


@pytest.mark.parametrize(
    ("config", "available"),
    [
        ({"max_rate": 0.0}, {0}),
        ({"max_rate": 0.0}, {0, 1, 2}),
        ({"max_rate": 1.0}, {0, 1}),
        ({"max_rate": 0.0, "pacing": "realtime"}, {0, 1}),
        ({"max_rate": 0.0, "video": "film.mp4"}, {0, 1}),
    ],
)
def test_elsewhere_the_system_decides(config, available):
    assert processors_of(SimulatorConfig(**config), available) == {}


def test_a_process_keeps_to_the_processors_it_is_given(tmp_path: Path):
    say = "import os; print(sorted(os.sched_getaffinity(0)))"
    mine = os.sched_getaffinity(0)
    with Processes(os.environ, tmp_path) as processes:
        processes.start("one", [sys.executable, "-c", say], {min(mine)})
        processes.start("any", [sys.executable, "-c", say])
        while processes.running("one") or processes.running("any"):
            pass
    assert processes.printed("one", f"[{min(mine)}]\n")
    assert processes.printed("any", f"{sorted(mine)}\n")


INTERRUPTED = """
import os, signal, sys
from pathlib import Path
from cassie_bags.errors import RunError
from cassie_bags.ros.processes import Processes
signal.signal(signal.SIGINT, signal.default_int_handler)
os.register_at_fork(before=lambda: os.kill(os.getpid(), signal.SIGINT))
processes = Processes(os.environ, Path(sys.argv[1]))
try:
    with processes:
        processes.start("sleeper", ["sleep", "60"])
        print("the Ctrl-C is lost")
except KeyboardInterrupt:
    print("stopped")
try:
    processes.check()
except RunError as error:
    print(error)
"""


def test_a_ctrl_c_while_a_process_starts_is_not_lost(tmp_path: Path):
    """Of hundreds of runs of the bench one went on."""
    program = [sys.executable, "-c", INTERRUPTED, str(tmp_path)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=90, check=True)
    assert done.stdout.splitlines() == ["stopped", "sleeper was ended by SIGINT"]


def test_a_domain_whose_lock_another_user_keeps_is_left_out(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    with own_domain() as first:
        lock = tmp_path / f"cassie_domain_{first}.run.lock"
        with own_domain() as second:
            assert second != first
    opened = os.open

    def theirs(path, flags, *mode, **folder):
        if path == lock and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, flags, *mode, **folder)

    monkeypatch.setattr("os.open", theirs)
    with own_domain() as again:
        assert again == first  # nobody holds it any more; reading is enough
    lock.unlink()
    lock.symlink_to(lock)  # cannot even be read
    with own_domain() as other:
        assert other == second
