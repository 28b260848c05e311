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
    "cassie_gaits": {"cassie_msgs"},
    "cassie_control": {"cassie_gaits", "cassie_msgs"},
    "cassie_sim": {"cassie_gaits", "cassie_msgs"},
    "cassie_teleop": {"cassie_msgs"},
    "cassie_bags": set(FOLDERS) - {"cassie_bags"},
}
LAYERS = ("bag", "signals", "run", "report", "studies")
"""Subpackages of cassie_bags, from below: each imports from those before it and itself only."""
FRONT = ("cli", "ros")
"""What stands above them: commands and nodes, which may start each other."""
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


def is_command_and_node(path, module):
    """Whether a command line starts nodes of its own package."""
    return path.parent.name == "cli" and module.startswith("cassie_bags.ros.")


@pytest.mark.parametrize("package", FOLDERS)
def test_only_ros_folders_import_ros(package):
    wrong = [
        f"{path.relative_to(ROOT)}: {module}"
        for path in FOLDERS[package].rglob("*.py")
        if "ros" not in path.relative_to(FOLDERS[package]).parts
        for module in imports(path)
        if is_ros(module) and not is_command_and_node(path, module)
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


def test_only_the_node_of_the_gaits_imports_messages():
    folder = FOLDERS["cassie_gaits"]
    users = {
        str(path.relative_to(folder))
        for path in folder.rglob("*.py")
        for module in imports(path)
        if module.split(".")[0] == "cassie_msgs" and module != "cassie_msgs.processes"
    }
    assert users == {"gait_message.py", "ros/gait_optimizer.py"}


@pytest.mark.parametrize("layer", LAYERS)
def test_layers_of_the_bags_import_only_what_lies_below_them(layer):
    folder = FOLDERS["cassie_bags"] / layer
    below = {*LAYERS[: LAYERS.index(layer) + 1], "errors"}
    found = [
        (path, module.split(".")[1])
        for path in folder.rglob("*.py")
        for module in imports(path)
        if module.startswith("cassie_bags.")
    ]
    assert found
    assert not [f"{path.relative_to(ROOT)}: {name}" for path, name in found if name not in below]


def test_bags_are_read_and_written_without_physics():
    loaded = {
        module.split(".")[0]
        for path in (FOLDERS["cassie_bags"] / "bag").rglob("*.py")
        for module in imports(path)
    }
    assert not loaded & {"mujoco", "cassie_sim", "cassie_control", "cassie_gaits", "matplotlib"}


def test_every_folder_of_the_bags_has_its_place():
    folders = {path.parent.name for path in FOLDERS["cassie_bags"].glob("*/__init__.py")}
    assert folders == {*LAYERS, *FRONT}


def test_the_reader_of_imports_sees_them(tmp_path):
    path = tmp_path / "module.py"
    path.write_text("import numpy as np\ndef f():\n    from rclpy.node import Node\n")
    assert list(imports(path)) == ["numpy", "rclpy.node"]
    assert is_ros("rclpy.node") and is_ros("cassie_msgs.ros.process")
    assert not is_ros("cassie_msgs.layout")
