"""Keeping processors awake: as the kernel wants it, and harmless where it is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from cassie_sim.ros.awake import DEVICE, Awake


def test_the_request_is_no_delay_and_ends_when_taken_back(tmp_path: Path) -> None:
    device = tmp_path / "latency"
    device.touch()
    awake = Awake(device)
    awake.hold(True)
    awake.hold(True)  # once is enough
    assert awake.held and device.read_bytes() == bytes(4)
    awake.hold(False)
    awake.hold(False)
    assert not awake.held and awake.refused == ""


def test_without_permission_everything_goes_on(tmp_path: Path) -> None:
    awake = Awake(tmp_path / "missing")
    awake.hold(True)
    assert not awake.held and "No such file" in awake.refused


@pytest.mark.skipif(not DEVICE.exists(), reason="the system takes no such requests")
def test_a_device_that_is_there_takes_it_or_says_why() -> None:
    awake = Awake()
    awake.hold(True)
    assert awake.held != bool(awake.refused)
    awake.hold(False)
    assert not awake.held
