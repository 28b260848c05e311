"""Parameters of a running node: described, followed, refused with the reason."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from pick_node import Config
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from cassie_msgs.ros.parameters import default_of
from cassie_msgs.tunables import entries

NODE = Path(__file__).with_name("pick_node.py")


@pytest.fixture
def picked():
    process = subprocess.Popen(
        [sys.executable, str(NODE), "--ros-args", "-p", "kp_knee:=300"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline().split() == ["ready", "300.0"]
    yield process
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=90) == 0


@pytest.fixture
def client(picked):
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("client", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def call(service_type, name, **fields):
        proxy = node.create_client(service_type, f"/picked/{name}")
        assert proxy.wait_for_service(timeout_sec=10)
        future = proxy.call_async(service_type.Request(**fields))
        executor.spin_until_future_complete(future, timeout_sec=10)
        return future.result()

    call.node, call.executor = node, executor
    yield call
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


def set_parameters(call, **values):
    parameters = [Parameter(k, value=v).to_parameter_msg() for k, v in values.items()]
    return call(SetParametersAtomically, "set_parameters_atomically", parameters=parameters).result


def test_descriptions_and_ranges_come_from_the_dataclass(client):
    names = ["kp_knee", "control_rate", "grade"]
    knee, rate, grade = client(DescribeParameters, "describe_parameters", names=names).descriptors
    assert knee.description == "stiffness of the knee (0 .. 2000 Nm/rad)"
    assert knee.floating_point_range[0].to_value == 2000.0
    assert rate.read_only and rate.integer_range[0].from_value == 50
    assert grade.additional_constraints == "one of ideal, faithful"


def test_descriptors_tell_the_default(client):
    defaults = {entry.name: entry.value for entry in entries(Config())}
    names = ["kp_knee", "control_rate", "grade", "trims"]
    found = client(DescribeParameters, "describe_parameters", names=names).descriptors
    told = {name: default_of(each) for name, each in zip(names, found, strict=True)}
    assert told == {name: defaults[name] for name in names} | {"trims": list(defaults["trims"])}
    assert default_of(ParameterDescriptor(description="by default something")) is None


def test_changes_are_followed_and_bad_ones_refused(client):
    assert set_parameters(client, kp_knee=250).successful
    assert set_parameters(client, trims=[0.05, -0.05]).successful
    for change, reason in [
        ({"kp_knee": 9000.0}, "9000"),
        ({"kp_knee": "soft"}, "kp_knee = 'soft' is not a number"),
        ({"trims": [0.5, 0.0]}, "trims[0] = 0.5 rad is outside -0.1 .. 0.1 rad"),
        ({"grade": "perfect"}, "is not one of ideal, faithful"),
        ({"control_rate": 1000}, "read-only"),
    ]:
        result = set_parameters(client, **change)
        assert not result.successful and reason in result.reason
    values = client(GetParameters, "get_parameters", names=["kp_knee", "control_rate"]).values
    assert (values[0].integer_value, values[1].integer_value) == (250, 500)


def test_a_change_of_health_is_on_diagnostics(client):
    seen = []
    client.node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: seen.extend(m.status), 10
    )
    assert set_parameters(client, kp_knee=123.0).successful
    deadline = time.monotonic() + 10
    while not any(s.message == "kp_knee 123" for s in seen) and time.monotonic() < deadline:
        client.executor.spin_once(timeout_sec=0.1)
    assert seen[-1].name == "picked: loop" and seen[-1].level == b"\x01"
