"""One node of a kind in a domain."""

import os
import signal
import subprocess
import sys

import pytest

from cassie_msgs.ros import claim

HOLDER = """
import rclpy, sys
from cassie_msgs.ros.claim import Claim
rclpy.init(args=sys.argv)
node = rclpy.create_node("first")
Claim(node, "simulator").take()
print("holds", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path, monkeypatch):
    """Another process that is the simulator of this domain."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout.readline() == b"holds\n"
    yield process
    process.kill()
    process.wait()


def test_a_second_one_is_refused_and_told_a_domain_that_is_free(node, holder):
    domain = os.environ["ROS_DOMAIN_ID"]
    with pytest.raises(
        claim.SecondNodeError, match=f"another simulator runs in ROS domain {domain}"
    ):
        claim.Claim(node, "simulator").take()
    free = claim.free_domain()
    assert free != int(domain) and free not in claim.RUN_DOMAINS


def test_another_kind_is_not(node, holder):
    claim.Claim(node, "gait_controller").take()


def test_the_claim_ends_with_a_process_that_is_killed(node, holder):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    claim.Claim(node, "simulator").take()


def test_runs_choose_domains_that_nobody_has(holder, monkeypatch):
    monkeypatch.setattr(claim, "RUN_DOMAINS", (int(os.environ["ROS_DOMAIN_ID"]), 77))
    with claim.run_domain() as domain:
        assert domain == 77
        with pytest.raises(claim.SecondNodeError, match="are all in use"), claim.run_domain():
            pass
