"""The saved views for RViz and Foxglove show what the nodes publish."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from std_msgs.msg import String

from cassie_gaits.link_frames import BASE_FRAME, FIXED_FRAMES, MOVING_FRAMES, ODOM_FRAME
from cassie_msgs.msg import Mode, RobotState, SupervisorStatus

TYPES = {
    "/odom": Odometry,
    "/robot_description": String,
    "/diagnostics": DiagnosticArray,
    "/cassie/mode": Mode,
    "/cassie/state": RobotState,
    "/cassie/supervisor_status": SupervisorStatus,
}
FRAMES = {ODOM_FRAME, BASE_FRAME, *(frame.name for frame in (*FIXED_FRAMES, *MOVING_FRAMES))}


@pytest.fixture(scope="module")
def config() -> Path:
    return Path(get_package_share_directory("cassie_sim"), "config")


@pytest.fixture(scope="module")
def layout(config: Path) -> dict[str, Any]:
    return json.loads((config / "cassie.foxglove.json").read_text())


@pytest.fixture(scope="module")
def rviz(config: Path) -> dict[str, Any]:
    return yaml.safe_load((config / "cassie.rviz").read_text())["Visualization Manager"]


def panels(node: Any) -> Iterator[str]:
    """Panels of a Foxglove layout: a tree of splits."""
    if isinstance(node, str):
        yield node
        return
    assert node["direction"] in ("row", "column")
    for part in ("first", "second"):
        yield from panels(node[part])


def test_foxglove_arranges_every_panel_once(layout: dict[str, Any]) -> None:
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    assert {name.partition("!")[0] for name in layout["configById"]} == {
        "3D", "Plot", "RawMessages", "DiagnosticSummary",
    }  # fmt: skip


def test_foxglove_follows_the_robot_that_the_topic_describes(layout: dict[str, Any]) -> None:
    scene = layout["configById"]["3D!robot"]
    assert scene["followTf"] == BASE_FRAME
    robot, grid = scene["layers"]["robot"], scene["layers"]["grid"]
    assert (robot["layerId"], robot["sourceType"]) == ("foxglove.Urdf", "topic")
    assert robot["topic"] in TYPES
    assert (grid["layerId"], grid["frameId"]) == ("foxglove.Grid", ODOM_FRAME)
    for name, layer in scene["layers"].items():
        assert layer["instanceId"] == name


def test_foxglove_plots_fields_that_there_are(layout: dict[str, Any]) -> None:
    seen = 0
    for name, panel in layout["configById"].items():
        paths = [path["value"] for path in panel.get("paths", [])]
        paths += [panel[key] for key in ("topicPath", "topicToRender") if key in panel]
        assert paths or name.startswith("3D")
        for path in paths:
            topic, *fields = path.split(".")
            value = TYPES[topic]()
            for field in fields:
                field, index = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", field).groups()
                value = getattr(value, field)
                value = value if index is None else value[int(index)]
            assert not fields or isinstance(value, float)
            seen += 1
    assert seen >= 10


def test_rviz_follows_the_robot_in_the_odometry_frame(rviz: dict[str, Any]) -> None:
    assert rviz["Global Options"]["Fixed Frame"] == ODOM_FRAME
    assert rviz["Views"]["Current"]["Target Frame"] == BASE_FRAME


def test_rviz_subscribes_to_what_is_published(rviz: dict[str, Any]) -> None:
    displays = {display["Class"].rpartition("/")[2]: display for display in rviz["Displays"]}
    model = displays["RobotModel"]["Description Topic"]
    assert model["Value"] == "/robot_description"
    assert model["Durability Policy"] == "Transient Local"
    assert displays["Odometry"]["Topic"]["Value"] == "/odom"
    assert displays["Grid"]["Reference Frame"] in FRAMES
    assert all("Enabled" in display for display in displays.values())
