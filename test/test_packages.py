"""What the packages declare is what they import, and colcon runs their tests."""

from __future__ import annotations

import functools
import json
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from catkin_pkg.package import parse_package
from colcon_core.task.python.test import has_test_dependency
from colcon_python_setup_py.package_identification.python_setup_py import get_setup_information
from test_layers import FOLDERS, imports

ROOT = Path(__file__).resolve().parents[1]
HELPERS = ROOT / "test"


class Supplier(NamedTuple):
    """What brings a module: a rosdep key, and a distribution of the Python package index.

    An empty string stands for none.
    """

    key: str
    distribution: str


ROS = (
    *("ament_index_python", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "nav_msgs"),
    *("rcl_interfaces", "rclpy", "rosgraph_msgs", "sensor_msgs", "std_msgs", "std_srvs"),
    "tf2_msgs",
)
SUPPLIERS = {
    **{name: Supplier(name, "") for name in (*ROS, *FOLDERS)},
    # Keys of rosdep's database (python.yaml and base.yaml of rosdistro), or of packages in Jazzy.
    "PIL": Supplier("python3-pil", "pillow"),
    "aiohttp": Supplier("python3-aiohttp", "aiohttp"),
    "casadi": Supplier("casadi-pip", "casadi"),
    "cma": Supplier("", "cma"),
    "distributed": Supplier("", "distributed"),
    "imageio": Supplier("python3-imageio", "imageio"),
    "jinja2": Supplier("python3-jinja2", "jinja2"),
    "llvmlite": Supplier("python3-numba", "llvmlite"),
    "lz4": Supplier("", ""),  # the extra `lz4`
    "matplotlib": Supplier("python3-matplotlib", "matplotlib"),
    "mcap": Supplier("", "mcap"),
    "mpl_toolkits": Supplier("python3-matplotlib", "matplotlib"),
    "mujoco": Supplier("python3-mujoco-pip", "mujoco"),
    "numba": Supplier("python3-numba", "numba"),
    "numpy": Supplier("python3-numpy", "numpy"),
    "pinocchio": Supplier("pinocchio", "pin"),
    "playwright": Supplier("", "playwright"),
    "pygame": Supplier("python3-pygame", "pygame"),
    "pyarrow": Supplier("", "pyarrow"),
    "pytest": Supplier("python3-pytest", "pytest"),
    "rosbags": Supplier("python3-rosbags-pip", "rosbags"),
    "scipy": Supplier("python3-scipy", "scipy"),
    "tqdm": Supplier("python3-tqdm", "tqdm"),
    "yaml": Supplier("python3-yaml", "PyYAML"),
    "zstandard": Supplier("", "zstandard"),
}
"""Who brings each module that the packages import."""

NOT_IMPORTED = {
    "ament_cmake_pytest",  # registers the tests of cassie_msgs
    "rcl",  # inbox.c of cassie_msgs
    "rcutils",
    "builtin_interfaces",  # field types of messages
    "std_msgs",
    "rosidl_default_runtime",
    "python3-pytest-timeout",  # plug-in of pytest
    "example-robot-data",  # meshes
    "imageio-ffmpeg",  # plug-in of imageio
    "nicegui",  # browser libraries
}
"""Keys and distributions that a package needs without an import."""


class Sources(NamedTuple):
    """Where a package has its declarations, modules and tests."""

    folder: Path
    modules: Path
    tests: Path


PACKAGES = {
    name: Sources(folder, FOLDERS[name], folder / "test")
    for name in FOLDERS
    for folder in [ROOT / ("bags" if name == "cassie_bags" else name)]
}


def modules(folder: Path, own: set[str]) -> set[str]:
    """Top-level modules that a folder's files import, beside Python's own and `own`."""
    found = {name.split(".")[0] for path in folder.rglob("*.py") for name in imports(path)}
    return found - sys.stdlib_module_names - own


@functools.cache
def setup_arguments(folder: Path) -> dict[str, Any]:
    """Arguments of `setup()` as colcon reads them; none without a setup.py."""
    setup = folder / "setup.py"
    return dict(get_setup_information(setup)) if setup.is_file() else {}


def differences(name: str, sources: Sources) -> list[str]:
    """Where a package's imports and its declarations do not agree, in words."""
    package = parse_package(str(sources.folder / "package.xml"))
    run = {dependency.name for dependency in package.exec_depends}
    test = {dependency.name for dependency in package.test_depends}
    setup = setup_arguments(sources.folder)
    helpers = {path.stem for folder in (sources.tests, HELPERS) for path in folder.glob("*.py")}
    at_run = modules(sources.modules, {name})
    in_tests = modules(sources.tests, {name} | helpers) - at_run

    wrong = [f"{module}: not in SUPPLIERS" for module in (at_run | in_tests) - set(SUPPLIERS)]
    at_run, in_tests = at_run & set(SUPPLIERS), in_tests & set(SUPPLIERS)
    keys = {SUPPLIERS[module].key for module in at_run} - {""}
    test_keys = {SUPPLIERS[module].key for module in in_tests} - {""}
    wrong += [f"package.xml has no exec_depend {key}" for key in keys - run]
    wrong += [f"package.xml has no test_depend {key}" for key in test_keys - run - test]
    unused = (run | test) - keys - test_keys - NOT_IMPORTED
    wrong += [f"package.xml has {key}, which nothing imports" for key in unused]
    if setup:
        required = set(setup["install_requires"])
        distributions = {SUPPLIERS[module].distribution for module in at_run} - {""}
        wrong += [f"setup.py does not require {name}" for name in distributions - required]
        unused = required - distributions - NOT_IMPORTED
        wrong += [f"setup.py requires {name}, which nothing imports" for name in unused]
    return sorted(wrong)


@pytest.mark.parametrize("name", PACKAGES)
def test_imports_are_declared(name: str) -> None:
    assert differences(name, PACKAGES[name]) == []


@pytest.mark.parametrize(
    ("line", "removed", "found"),
    [
        ("import tf2_msgs.msg", "", ["package.xml has no exec_depend tf2_msgs"]),
        ("import zstandard", "", ["setup.py does not require zstandard"]),
        ("import nobody_knows_it", "", ["nobody_knows_it: not in SUPPLIERS"]),
        ("import json, os", "", []),
        (
            "",
            "<exec_depend>python3-matplotlib</exec_depend>",
            ["package.xml has no exec_depend python3-matplotlib"],
        ),
        ("", '        "casadi",\n', ["setup.py does not require casadi"]),
        ("", "<test_depend>python3-pytest</test_depend>", None),
    ],
)
def test_a_missing_declaration_is_seen(
    tmp_path: Path, line: str, removed: str, found: list[str] | None
) -> None:
    real = PACKAGES["cassie_gaits"]
    copy = Sources(tmp_path, tmp_path / "cassie_gaits", real.tests)
    shutil.copytree(real.modules, copy.modules, ignore=shutil.ignore_patterns("__pycache__"))
    (copy.modules / "one_more.py").write_text(line)
    shutil.copy(real.folder / "README.md", tmp_path)
    for name in ("package.xml", "setup.py"):
        (tmp_path / name).write_text((real.folder / name).read_text().replace(removed or "\0", ""))
    if found is None:
        found = ["package.xml has no test_depend python3-pytest"]
    assert differences("cassie_gaits", copy) == found


def test_a_declaration_that_nothing_needs_is_seen(tmp_path: Path) -> None:
    real = PACKAGES["cassie_gaits"]
    empty = Sources(real.folder, tmp_path, real.tests)
    assert "setup.py requires casadi, which nothing imports" in differences("cassie_gaits", empty)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_says_whose_it_is_and_what_for(name: str) -> None:
    folder = PACKAGES[name].folder
    package = parse_package(str(folder / "package.xml"))
    assert (package.name, package.licenses) == (name, ["Apache-2.0"])
    assert package.description
    assert package.maintainers and package.urls
    assert len((folder / "README.md").read_text(encoding="utf-8").splitlines()) > 20
    if setup := setup_arguments(folder):
        (maintainer,), (url,) = package.maintainers, package.urls
        told = (package.name, package.version, maintainer.name, maintainer.email, url.url)
        keys = ("name", "version", "maintainer", "maintainer_email", "url")
        assert tuple(setup["metadata"][key] for key in keys) == told
        assert setup["metadata"]["license"] == "Apache-2.0"


@pytest.mark.parametrize("name", sorted(set(PACKAGES) - {"cassie_msgs"}))
def test_ctrl_c_is_heeded_before_a_program_imports_what_takes_long(name: str) -> None:
    """Console scripts go through `cassie_msgs.processes.entry_point`, which imports the rest."""
    module = f"{name}.executables"
    scripts = setup_arguments(PACKAGES[name].folder)["entry_points"]["console_scripts"]
    names = [script.partition(" = ")[0] for script in scripts]
    assert scripts == [f"{each} = {module}:{each}" for each in names]
    code = f"import sys, {module}; assert callable({module}.{names[0]}); print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not {"numpy", "rclpy", "mujoco", "argparse"} & set(loaded.stdout.split())
    found = dict(re.findall(r'(\w+) = entry_point\("([\w.]+)"\)', source(name)))
    assert sorted(found) == sorted(names)
    assert all(find_spec(target) for target in found.values())


def source(name: str) -> str:
    """Text of the module that names a package's executables."""
    return (PACKAGES[name].modules / "executables.py").read_text(encoding="utf-8")


def test_all_packages_have_one_version() -> None:
    found = {parse_package(str(s.folder / "package.xml")).version for s in PACKAGES.values()}
    assert len(found) == 1


def test_colcon_runs_the_tests_of_python_packages(tmp_path: Path) -> None:
    """With a package's own setup.py and with other tests: one that passes, one that fails."""
    real = PACKAGES["cassie_teleop"].folder
    package = tmp_path / "src"
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "test")
    shutil.copytree(real, package, ignore=ignored)
    (package / "test").mkdir()
    file = package / "test" / "test_two.py"
    file.write_text("def test_it(): pass\ndef test_other(): assert False\n")

    def colcon(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "colcon", *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    for verb in ("build", "test"):
        done = colcon(verb, "--packages-select", "cassie_teleop")
        assert done.returncode == 0, done.stdout + done.stderr
    done = colcon("test-result")
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1] == "Summary: 2 tests, 0 errors, 1 failure, 0 skipped"


@pytest.mark.parametrize("name", sorted(set(PACKAGES) - {"cassie_msgs"}))
def test_colcon_takes_pytest_for_each_python_package(name: str) -> None:
    assert has_test_dependency(setup_arguments(PACKAGES[name].folder), "pytest")


def test_colcon_runs_the_tests_of_the_messages() -> None:
    done = subprocess.run(
        ["ctest", "--show-only=json-v1", "--test-dir", ROOT / "build" / "cassie_msgs"],
        capture_output=True,
        text=True,
        check=True,
    )
    (test,) = json.loads(done.stdout)["tests"]
    assert str(ROOT / "cassie_msgs" / "test") in test["command"]
