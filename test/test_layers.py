"""Who may import whom: cores know no ROS, and packages only what lies below them."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {
    "cassie_msgs": ROOT / "cassie_msgs/python/cassie_msgs",
    "cassie_gaits": ROOT / "cassie_gaits/cassie_gaits",
    "cassie_control": ROOT / "cassie_control/cassie_control",
    "cassie_sim": ROOT / "cassie_sim/cassie_sim",
    "cassie_teleop": ROOT / "cassie_teleop/cassie_teleop",
    "cassie_bags": ROOT / "bags/cassie_bags",
}
MAY_IMPORT = {
    "cassie_msgs": set(),
    "cassie_gaits": set(),
    "cassie_control": {"cassie_gaits", "cassie_msgs"},
    "cassie_sim": {"cassie_gaits", "cassie_msgs"},
    "cassie_teleop": {"cassie_msgs"},
    "cassie_bags": set(FOLDERS) - {"cassie_bags"},
}
ROS = {"rclpy", "ament_index_python", "rcl_interfaces", "builtin_interfaces", "std_msgs"}
ROS |= {"sensor_msgs", "nav_msgs", "geometry_msgs", "diagnostic_msgs", "rosgraph_msgs", "tf2_msgs"}


def imports(path):
    """Full names of the modules a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


def is_ros(module):
    """Whether a module is part of ROS, or one of ours that is."""
    parts = module.split(".")
    return parts[0] in ROS or (
        parts[0].startswith("cassie_") and parts[1:2] in (["ros"], ["msg"], ["srv"])
    )


@pytest.mark.parametrize("package", FOLDERS)
def test_only_ros_folders_import_ros(package):
    wrong = [
        f"{path.relative_to(ROOT)}: {module}"
        for path in FOLDERS[package].rglob("*.py")
        if "ros" not in path.relative_to(FOLDERS[package]).parts
        for module in imports(path)
        if is_ros(module)
    ]
    assert not wrong


@pytest.mark.parametrize("package", FOLDERS)
def test_packages_import_only_what_lies_below_them(package):
    wrong = [
        f"{path.relative_to(ROOT)}: {module}"
        for path in FOLDERS[package].rglob("*.py")
        for module in imports(path)
        if module.split(".")[0] in set(FOLDERS) - MAY_IMPORT[package] - {package}
    ]
    assert not wrong


def test_the_reader_of_imports_sees_them(tmp_path):
    path = tmp_path / "module.py"
    path.write_text("import numpy as np\ndef f():\n    from rclpy.node import Node\n")
    assert list(imports(path)) == ["numpy", "rclpy.node"]
    assert is_ros("rclpy.node") and is_ros("cassie_msgs.ros.process")
    assert not is_ros("cassie_msgs.layout")
