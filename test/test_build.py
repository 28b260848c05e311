"""`make build`, as far as it can be told without building."""

from __future__ import annotations

import json
import os
import subprocess
from importlib import import_module
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory

ROOT = Path(__file__).resolve().parents[1]
WORKSPACE = ROOT / ".workspace"
CPU_INFO = Path("/proc/cpuinfo").read_text()


def test_a_new_environment_leaves_results_where_they_are(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(WORKSPACE)
    build = import_module("build")
    results = tmp_path / "build" / "sweeps" / "sweeps.json"
    caches = [tmp_path / "build" / name / "cache" for name in ("cassie_msgs", "cassie_bags")]
    for file in (results, *caches, tmp_path / "install" / "made_from"):
        file.parent.mkdir(parents=True)
        file.write_text("old old")
    monkeypatch.setattr(build, "ROOT", tmp_path)
    monkeypatch.setattr(build, "call", lambda *_: (tmp_path / "install").mkdir())
    assert build.bring_up_workspace("new")
    assert results.exists()
    assert not any(cache.exists() for cache in caches)
    assert not build.bring_up_workspace("new")


def test_tf2_msgs_is_built_where_the_environment_has_none(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(WORKSPACE)
    build = import_module("build")
    monkeypatch.setattr(build, "VENV", tmp_path)
    assert build.packages() == (build.TF2_MSGS, *build.PACKAGES)
    marker = tmp_path / "share/ament_index/resource_index/packages/tf2_msgs"
    marker.parent.mkdir(parents=True)
    marker.touch()
    assert build.packages() == build.PACKAGES


def test_its_message_is_that_of_ros() -> None:
    """Nodes of a system ROS 2 Jazzy take it for theirs: the hash covers names and types."""
    share = Path(get_package_share_directory("tf2_msgs"))
    found = json.loads((share / "msg/TFMessage.json").read_text())["type_hashes"]
    assert {
        "type_name": "tf2_msgs/msg/TFMessage",
        "hash_string": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    } in found


@pytest.mark.skipif("avx2" not in CPU_INFO, reason="a processor without AVX2")
def test_processors_with_wider_registers_sum_in_the_same_order(tmp_path: Path) -> None:
    """With other kernels of OpenBLAS the same seed gives another run."""
    program = tmp_path / "core_name.py"
    program.write_text(
        "import ctypes, os, pathlib, numpy\n"
        "folder = pathlib.Path(numpy.__file__).parents[1] / 'numpy.libs'\n"
        "(file,) = folder.glob('libscipy_openblas*.so*')\n"
        "ask = ctypes.CDLL(str(file)).scipy_openblas_get_corename64_\n"
        "ask.restype = ctypes.c_char_p\n"
        "print(os.environ['OPENBLAS_CORETYPE'], ask().decode())\n"
    )
    assert in_the_environment(program, without="OPENBLAS_CORETYPE").split() == ["Haswell"] * 2


def test_a_program_that_begins_starts_no_process_that_ctrl_c_could_hit(tmp_path: Path) -> None:
    """GLFW's Python package looks for its library so, and writes a traceback when interrupted."""
    program = tmp_path / "begin.py"
    program.write_text(
        "import sys\n"
        "started = []\n"
        "sys.addaudithook(lambda event, _: started.append(event) if 'Popen' in event else None)\n"
        "import mujoco, mujoco.viewer\n"
        "print(len(started))\n"
    )
    assert in_the_environment(program, without="PYGLFW_LIBRARY") == "0\n"


def in_the_environment(program: Path, without: str) -> str:
    """What a program prints in a new shell that has read env.sh, and did not have a variable."""
    plain = {k: v for k, v in os.environ.items() if k not in (without, "ROS_DISTRO")}
    script = f'. ./env.sh && python3 "{program}"'
    done = subprocess.run(
        ["sh", "-c", script], cwd=ROOT, env=plain, capture_output=True, text=True, check=True
    )
    return done.stdout
