"""`make dist`: what goes into a release."""

from __future__ import annotations

import os
import subprocess
import zipfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

pytestmark = pytest.mark.filterwarnings("ignore:setup.py install is deprecated")

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>1.2.3</version>
  <description>A package.</description>
  <maintainer email="somebody@example.org">Somebody</maintainer>
  <license>Apache-2.0</license>
  <url type="website">https://example.org/package</url>
  <exec_depend>cassie_other</exec_depend>
  <exec_depend>tf2_msgs</exec_depend>
  <exec_depend>python3-numpy</exec_depend>
  <export><build_type>{build_type}</build_type></export>
</package>
"""
REQUIREMENTS = """# Here.

# ROS 2 Jazzy, to run
ros-jazzy-rclpy==1.0
ros-rclpy[fastrtps]==1.0

# ROS 2 Jazzy, to build cassie_msgs
ros-jazzy-ament-cmake==1.0
"""


@pytest.fixture
def dist(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Module of `make dist`."""
    monkeypatch.syspath_prepend(ROOT / ".workspace")
    yield import_module("dist")


def write(path: Path, text: str = "") -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def installed(workspace: Path, dist: ModuleType, name: str, build_type: str) -> None:
    """A workspace with a package as colcon leaves it."""
    write(workspace / name / "package.xml", PACKAGE.format(name=name, build_type=build_type))
    write(workspace / name / "README.md", "# A package")
    write(workspace / "LICENSE", "A licence.")
    write(workspace / "requirements.txt", REQUIREMENTS)
    for file in ("env.sh", ".workspace/ros2_calls.py", ".workspace/bin/ros2"):
        write(workspace / file, "# here\n")
    for other in ("cassie_other", "tf2_msgs"):
        (workspace / "install" / other).mkdir(parents=True)
    prefix = workspace / "install" / name
    modules = prefix / dist.SITE_PACKAGES
    write(modules / name / "__init__.py")
    write(modules / name / "table.json", "{}")
    write(modules / name / "inner" / "module.py")
    write(modules / name / "__pycache__" / "module.nbi")
    write(modules / f"{name}-1.2.3-py3.egg-info" / "PKG-INFO", f"Name: {name}\nVersion: 1.2.3\n")
    share = prefix / "share"
    write(share / "ament_index" / "resource_index" / "packages" / name)
    write(share / "ament_index" / "resource_index" / "parent_prefix_path" / name, str(workspace))
    write(share / name / "package.xml", "")
    write(share / name / "cmake" / "Config.cmake", str(workspace))
    write(share / name / "local_setup.bash", str(workspace))


def content(wheel: Path) -> dict[str, str]:
    with zipfile.ZipFile(wheel) as file:
        return {name: file.read(name).decode() for name in file.namelist()}


def required(files: dict[str, str]) -> list[str]:
    (metadata,) = (text for name, text in files.items() if name.endswith("METADATA"))
    return [line[15:] for line in metadata.splitlines() if line.startswith("Requires-Dist: ")]


def test_a_wheel_holds_what_colcon_installs(dist: ModuleType, tmp_path: Path) -> None:
    workspace, name = tmp_path / "workspace", "cassie_thing"
    installed(workspace, dist, name, "ament_python")
    prefix = workspace / "install" / name
    info = prefix / dist.SITE_PACKAGES / f"{name}-1.2.3-py3.egg-info"
    write(info / "entry_points.txt", "[console_scripts]\nact = cassie_thing.inner.module:main\n")
    write(info / "requires.txt", "numpy\n\n[test]\npytest\n")
    write(prefix / "lib" / name / "act", f"#!{workspace}/python\nprint('acts')\n")
    before = Path.cwd()
    dist.make_wheel(workspace, name, tmp_path)
    assert Path.cwd() == before

    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name == "cassie_thing-1.2.3-py3-none-any.whl"
    files = content(wheel)
    data = "cassie_thing-1.2.3.data/data"
    assert {file for file in files if "dist-info" not in file} == {
        "cassie_thing/__init__.py",
        "cassie_thing/table.json",
        "cassie_thing/inner/module.py",
        f"{data}/lib/cassie_thing/act",
        f"{data}/share/ament_index/resource_index/packages/cassie_thing",
        f"{data}/share/cassie_thing/package.xml",
    }
    assert files[f"{data}/lib/cassie_thing/act"] == "#!/usr/bin/env python3\nprint('acts')\n"
    assert not any(str(workspace) in text for text in files.values())
    assert required(files) == ["cassie_other==1.2.3", "cassie_tf2_msgs==1.2.3", "numpy"]
    with zipfile.ZipFile(wheel) as file:
        assert file.getinfo(f"{data}/lib/cassie_thing/act").external_attr >> 16 & 0o111


def test_the_wheel_of_the_messages_is_for_one_python_and_brings_ros(
    dist: ModuleType, tmp_path: Path
) -> None:
    workspace, name = tmp_path / "workspace", "cassie_msgs"
    installed(workspace, dist, name, "ament_cmake")
    write(workspace / "install" / name / "lib" / "libcassie_msgs.so")
    dist.make_wheel(workspace, name, tmp_path)

    (wheel,) = tmp_path.glob("*.whl")
    assert "py3-none-any" not in wheel.name
    files = content(wheel)
    assert {
        "cassie_msgs-1.2.3.data/data/lib/libcassie_msgs.so",
        "cassie_msgs-1.2.3.data/data/share/cassie_msgs/env.sh",
        "cassie_msgs-1.2.3.data/data/share/cassie_msgs/ros2_calls.py",
        "cassie_msgs-1.2.3.data/data/share/cassie_msgs/bin/ros2",
    } <= set(files)
    assert required(files)[2:] == ["ros-jazzy-rclpy==1.0", "ros-rclpy[fastrtps]==1.0", "numpy"]


def test_a_release_is_of_a_commit(
    dist: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dist, "ROOT", tmp_path)
    monkeypatch.setattr(dist, "OUT", tmp_path / "out")
    with pytest.raises(dist.BuildError, match="git status"):
        dist.archive("1.2.3")
    write(tmp_path / ".gitignore", "/out/\n")
    write(tmp_path / "file")
    write(tmp_path / "out" / "old")
    identity = ("-c", "user.name=Somebody", "-c", "user.email=somebody@example.org")
    dist.git("init", "-q")
    with pytest.raises(dist.BuildError, match="not committed"):
        dist.archive("1.2.3")
    dist.git("add", ".")
    dist.git(*identity, "commit", "-q", "-m", "All")
    tarball = dist.archive("1.2.3")
    listed = subprocess.run(["tar", "-tzf", tarball], capture_output=True, text=True, check=True)
    assert listed.stdout.split() == [
        "cassie-ros2-1.2.3/",
        "cassie-ros2-1.2.3/.gitignore",
        "cassie-ros2-1.2.3/file",
    ]


def test_a_shell_for_wheels_needs_no_workspace(tmp_path: Path) -> None:
    environment = tmp_path / "environment"
    share = environment / "share" / "cassie_msgs"
    write(share / "env.sh", (ROOT / "env.sh").read_text())
    write(share / "bin" / "ros2", "#!/bin/sh\necho $AMENT_PREFIX_PATH $LD_LIBRARY_PATH\n")
    (share / "bin" / "ros2").chmod(0o755)
    plain = {"PATH": os.environ["PATH"], "HOME": str(tmp_path)}
    script = f'cd / && . "{share}/env.sh" && ros2'
    done = subprocess.run(
        ["bash", "-c", script], env=plain, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == [str(environment), str(environment / "lib")]
