"""Environment and workspace, brought up to date: `make build`.

Creates .venv from the pinned requirements, relocates the wheels' CMake files, builds the
packages with colcon and holds that rclpy and cassie_msgs import. Each part is skipped
while what it depends on is unchanged. Needs the standard library only.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HERE = ROOT / ".workspace"
VENV = ROOT / ".venv"
PACKAGES = ("cassie_msgs", "cassie_gaits", "cassie_control", "cassie_sim", "cassie_teleop", "bags")
TF2_MSGS = ".workspace/tf2_msgs"  # built where the environment has none
VENV_INPUTS = [ROOT / "requirements.txt", HERE / "constraints.txt", HERE / "relocate_wheels.py"]
# Edits of other Python files need no build: colcon links them into place. Those beside the messages
# it copies, because the package is the message generator's.
COPIED = ROOT / "cassie_msgs/python"
CONTENT_MATTERS = {".c", ".msg", ".srv", ".txt", ".xml", ".cfg"}


class BuildError(Exception):
    """Something a person must do first; the message says what."""


def main() -> int:
    """Bring everything up to date; returns the exit status."""
    start = time.monotonic()
    try:
        check_tools()
        venv_stamp = bring_up_environment()
        built = bring_up_workspace(venv_stamp)
        compile_kernels(venv_stamp)
        verify()
    except BuildError as error:
        print(f"make build: {error}", file=sys.stderr)
        return 1
    state = "built" if built else "up to date"
    print(f"make build: workspace {state} ({time.monotonic() - start:.1f} s)")
    return 0


def check_tools() -> None:
    """Hold that compilers, Python's headers and venv are there.

    Raises:
        BuildError: naming the Debian package of the first that is missing.
    """
    for program, package in (("gcc", "gcc"), ("g++", "g++"), ("make", "make")):
        if shutil.which(program) is None:
            raise BuildError(f"{program} is missing: apt install {package}")
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    header = Path(sysconfig.get_paths()["include"], "Python.h")
    if not header.is_file():
        raise BuildError(f"{header} is missing: apt install python{version}-dev")
    try:
        import ensurepip  # noqa: F401
    except ImportError:
        raise BuildError(f"Python's venv is missing: apt install python{version}-venv") from None


def bring_up_environment() -> str:
    """Create or renew .venv; returns the stamp of what it was made from."""
    contents = [path.read_bytes() for path in VENV_INPUTS]
    stamp = digest([str(ROOT).encode(), *contents])
    record = VENV / "made_from"
    if record.is_file() and record.read_text() == stamp:
        return stamp
    print(f"make build: creating .venv with Python {sys.version.split()[0]} (a minute or two)")
    shutil.rmtree(VENV, ignore_errors=True)
    call([sys.executable, "-m", "venv", str(VENV)], os.environ.copy())
    pip = [str(VENV / "bin/python"), "-m", "pip", "--disable-pip-version-check", "-q", "install"]
    call([*pip, "-r", str(VENV_INPUTS[0]), "-c", str(VENV_INPUTS[1])], clean_environment())
    call([str(VENV / "bin/python"), str(VENV_INPUTS[2])], environment())
    record.write_text(stamp)
    return stamp


def bring_up_workspace(venv_stamp: str) -> bool:
    """Build the packages if their sources or the environment changed; says whether it did."""
    stamp = digest([venv_stamp.encode(), *source_facts()])
    record = ROOT / "install" / "made_from"
    old = record.read_text().split() if record.is_file() else ["", ""]
    if old == [venv_stamp, stamp]:
        return False
    if old[0] != venv_stamp:  # CMake caches of another environment are of no use
        shutil.rmtree(ROOT / "install", ignore_errors=True)
        for package in packages():  # the rest of build/ are somebody's results
            shutil.rmtree(ROOT / "build" / package_name(package), ignore_errors=True)
    record.unlink(missing_ok=True)
    for name in map(package_name, PACKAGES):  # programs that are no more would stay
        shutil.rmtree(ROOT / "install" / name / "lib" / name, ignore_errors=True)
    print("make build: building the packages with colcon")
    build_packages(ROOT, "--symlink-install")
    record.write_text(f"{venv_stamp} {stamp}")
    return True


def build_packages(folder: Path, *options: str) -> None:
    """Build the packages in a folder with colcon.

    Raises:
        BuildError: if that fails.
    """
    python = str(VENV / "bin/python")
    call(
        [
            *(python, "-m", "colcon", "--log-base", "build/log", "build", *options),
            *("--base-paths", *packages()),
            *("--cmake-args", "-G", "Ninja", "-DBUILD_TESTING=ON"),
            *(f"-DPython3_EXECUTABLE={python}", f"-DPYTHON_EXECUTABLE={python}"),
            "--no-warn-unused-cli",
        ],
        environment(),
        folder,
    )


def packages() -> tuple[str, ...]:
    """Folders of the packages to build."""
    in_environment = VENV / "share/ament_index/resource_index/packages/tf2_msgs"
    return PACKAGES if in_environment.exists() else (TF2_MSGS, *PACKAGES)


def package_name(folder: str) -> str:
    """Name of the package in a folder."""
    return "cassie_bags" if folder == "bags" else Path(folder).name


def compile_kernels(venv_stamp: str) -> None:
    """Make the machine code of the compiled functions, so that no node waits for it."""
    sources = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    texts = [text for text in (path.read_bytes() for path in sources) if b"numba" in text]
    texts += [path.read_bytes() for path in sources if b"@compiled" in path.read_bytes()]
    stamp = digest([venv_stamp.encode(), *texts])
    record = ROOT / "install" / "compiled_from"
    if record.is_file() and record.read_text() == stamp:
        return
    print("make build: compiling the inner loops")
    script = ". ./env.sh && exec python3 .workspace/compile_kernels.py"
    call(["sh", "-c", script], os.environ.copy())
    record.write_text(stamp)


def source_facts() -> Iterable[bytes]:
    """What the build depends on: the names of all files, and the content of some."""
    for package in packages():
        for path in sorted((ROOT / package).rglob("*")):
            if not path.is_file() or "__pycache__" in path.parts or ".egg-info" in str(path):
                continue
            yield str(path.relative_to(ROOT)).encode()
            copied = path.is_relative_to(COPIED)
            if copied or path.suffix in CONTENT_MATTERS or path.name == "setup.py":
                yield path.read_bytes()
    yield Path(__file__).read_bytes()


def verify() -> None:
    """Hold that the client library and the messages import in the shell of env.sh.

    Raises:
        BuildError: if they do not.
    """
    script = '. ./env.sh && exec python3 -c "import rclpy, tf2_msgs.msg, cassie_msgs.layout"'
    result = subprocess.run(["sh", "-c", script], cwd=ROOT, capture_output=True, text=True)
    if result.returncode != 0:
        last = (result.stderr.strip().splitlines() or ["no message"])[-1]
        raise BuildError(f"rclpy and cassie_msgs do not import: {last} (try: make distclean build)")


def clean_environment() -> dict[str, str]:
    """The caller's environment without traces of another ROS or Python."""
    traces = ("AMENT_", "COLCON_", "CMAKE_PREFIX", "ROS_", "_ROS_", "PYTHON", "VIRTUAL_ENV")
    kept = {k: v for k, v in os.environ.items() if not k.startswith(traces)}
    kept.pop("LD_LIBRARY_PATH", None)
    return kept


def environment() -> dict[str, str]:
    """Environment in which the wheels are the ROS prefix."""
    env = clean_environment()
    env["PATH"] = f"{VENV / 'bin'}:{env.get('PATH', '')}"
    env["AMENT_PREFIX_PATH"] = env["CMAKE_PREFIX_PATH"] = str(VENV)
    env["VIRTUAL_ENV"] = str(VENV)
    env["ROS_DISTRO"] = "jazzy"
    env["ROS_VERSION"], env["ROS_PYTHON_VERSION"] = "2", "3"
    return env


def call(command: list[str], env: dict[str, str], folder: Path = ROOT) -> None:
    """Run a command in a folder.

    Raises:
        BuildError: if it fails; its own output has said why.
    """
    result = subprocess.run(command, cwd=folder, env=env)
    if result.returncode != 0:
        shown = " ".join(Path(part).name if part.startswith("/") else part for part in command)
        raise BuildError(f"this failed, its output is above: {shown}")


def digest(parts: Iterable[bytes]) -> str:
    """Hash over the parts and the borders between them."""
    total = hashlib.sha256()
    for part in parts:
        total.update(hashlib.sha256(part).digest())
    return total.hexdigest()


if __name__ == "__main__":
    sys.exit(main())
