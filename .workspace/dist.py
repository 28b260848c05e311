"""A release in build/dist: `make dist`.

    cassie-ros2-VERSION.tar.gz   the committed sources, a workspace for `make build` or colcon
    cassie_*.whl                 what colcon installs of each package, for this Python
    constraints.txt              pinned versions of everything that the wheels require

The wheels are built from the tarball. Wheels of a release are for the ROS wheels that they are
built with; with another ROS 2, build the tarball.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import warnings
from collections.abc import Iterator
from importlib.metadata import PathDistribution
from pathlib import Path

from build import HERE, PACKAGES, ROOT, BuildError, build_packages, packages
from catkin_pkg.package import Package, parse_package
from setuptools import Distribution, SetuptoolsDeprecationWarning, setup

OUT = ROOT / "build" / "dist"
SITE_PACKAGES = Path("lib", f"python{sysconfig.get_python_version()}", "site-packages")
# What other packages' builds need: it names folders of the machine that built it.
NOT_RELEASED = {"cmake", "colcon-core", "environment", "hook", "include", "parent_prefix_path"}
NOT_RELEASED_SUFFIXES = {".bash", ".c", ".dsv", ".nbc", ".nbi", ".ps1", ".pyc", ".sh", ".zsh"}
ENVIRONMENT = {"": ("env.sh", ".workspace/ros2_calls.py"), "bin": (".workspace/bin/ros2",)}
"""Files of the sources, by folder in share/cassie_msgs, that make a shell for the wheels."""


class Compiled(Distribution):
    """Has libraries for one Python."""

    def has_ext_modules(self) -> bool:
        """Whether the wheel is for this Python alone."""
        return True


def main() -> int:
    """Make the release; returns the exit status."""
    warnings.simplefilter("ignore", SetuptoolsDeprecationWarning)  # that no wheel comes of setup.py
    logging.disable(logging.WARNING)
    try:
        shutil.rmtree(OUT, ignore_errors=True)
        OUT.mkdir(parents=True)
        version = parse_package(str(ROOT / PACKAGES[0] / "package.xml")).version
        tarball = archive(version)
        with tempfile.TemporaryDirectory() as folder:
            shutil.unpack_archive(tarball, folder)
            (sources,) = Path(folder).iterdir()
            build_packages(sources)
            for package in packages():
                make_wheel(sources, package, OUT)
    except BuildError as error:
        print(f"make dist: {error}", file=sys.stderr)
        return 1
    shutil.copy(HERE / "constraints.txt", OUT)
    for path in sorted(OUT.iterdir()):
        print(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1e6:.1f} MB")
    return 0


def archive(version: str) -> Path:
    """Make the tarball of the committed sources; returns its path.

    Raises:
        BuildError: outside a git repository, or where something is not committed.
    """
    name = f"cassie-ros2-{version}"
    tarball = OUT / f"{name}.tar.gz"
    if git("status", "--porcelain"):
        raise BuildError("something is not committed (git status): a release is of a commit")
    git("archive", f"--prefix={name}/", f"--output={tarball}", "HEAD")
    return tarball


def git(*words: str) -> str:
    """What a command of git prints.

    Raises:
        BuildError: if it fails, or there is no git.
    """
    if shutil.which("git") is None:
        raise BuildError("git is missing: apt install git")
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BuildError(f"git {words[0]}: {done.stderr.strip()}")
    return done.stdout.strip()


def make_wheel(sources: Path, folder: str, out: Path) -> None:
    """Make the wheel of a package that is built and installed in a workspace.

    Args:
        sources: Workspace, with its `install` folder.
        folder: The package's folder in it.
        out: Folder for the wheel.
    """
    package = parse_package(str(sources / folder / "package.xml"))
    name = package.name
    prefix = sources / "install" / name
    (installed,) = (prefix / SITE_PACKAGES).glob(f"{name}-*.egg-info")
    with workspace_for(prefix, name) as files:
        if name == "cassie_msgs":
            for target, paths in ENVIRONMENT.items():
                folder_there = files / "share" / name / target
                folder_there.mkdir(exist_ok=True)
                for path in paths:
                    shutil.copy(sources / path, folder_there)
        shutil.copy(sources / "LICENSE", files)
        entry_points = installed / "entry_points.txt"
        readme = sources / folder / "README.md"
        maintainer = package.maintainers[0]
        setup(
            script_args=["-q", "bdist_wheel", "--dist-dir", str(out)],
            distclass=Compiled if list(files.rglob("*.so")) else Distribution,
            name=distribution(name),
            version=package.version,
            description=package.description,
            long_description=readme.read_text(encoding="utf-8") if readme.is_file() else "",
            long_description_content_type="text/markdown",
            url=package.urls[0].url if package.urls else "",
            license=package.licenses[0],
            maintainer=maintainer.name,
            maintainer_email=maintainer.email,
            python_requires=">=3.10",
            install_requires=requirements(sources, package, installed),
            packages=modules(files / name),
            package_data={"": ["*"]},
            data_files=data_files(files),
            entry_points=entry_points.read_text() if entry_points.is_file() else "",
            zip_safe=False,
        )


@contextlib.contextmanager
def workspace_for(prefix: Path, name: str) -> Iterator[Path]:
    """Go to a folder with what is released of an installed package: `name`, lib and share."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder)
        shutil.copytree(prefix / SITE_PACKAGES / name, files / name, ignore=left_out)
        shutil.copytree(prefix / "share", files / "share", ignore=left_out)
        (files / "lib").mkdir()
        for library in prefix.glob("lib/*.so"):
            shutil.copy(library, files / "lib")
        for program in prefix.glob(f"lib/{name}/*"):
            (files / "lib" / name).mkdir(exist_ok=True)
            copy = files / "lib" / name / program.name
            lines = program.read_text(encoding="utf-8").splitlines(keepends=True)
            copy.write_text("".join(["#!/usr/bin/env python3\n", *lines[1:]]), encoding="utf-8")
            copy.chmod(0o755)
        os.chdir(files)
        try:
            yield files
        finally:
            os.chdir(before)


def left_out(_: str, names: list[str]) -> set[str]:
    """Names of files and folders that are of no use away from the machine that built them."""
    return {n for n in names if n in NOT_RELEASED or Path(n).suffix in NOT_RELEASED_SUFFIXES}


def distribution(name: str) -> str:
    """Name of a package's wheel; tf2_msgs of this workspace is not ROS's own."""
    return name if name.startswith("cassie_") else f"cassie_{name}"


def requirements(sources: Path, package: Package, installed: Path) -> list[str]:
    """Distributions that a wheel requires: other packages, ROS, and those of setup.py."""
    released = {path.name for path in (sources / "install").iterdir()}
    own = [
        f"{distribution(dependency.name)}=={package.version}"
        for dependency in package.exec_depends
        if dependency.name in released
    ]
    if package.get_build_type() == "ament_cmake":
        text = (sources / "requirements.txt").read_text(encoding="utf-8")
        _, _, ros = text.partition("# ROS 2 Jazzy, to run\n")
        return [*own, *ros.partition("\n\n")[0].splitlines(), "numpy"]
    listed = PathDistribution(installed).requires or []
    return own + [requirement for requirement in listed if "extra ==" not in requirement]


def modules(folder: Path) -> list[str]:
    """Names of all Python packages in a folder and below, with those that have no __init__.py."""
    folders = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
    return [".".join(path.relative_to(folder.parent).parts) for path in sorted(folders)]


def data_files(files: Path) -> list[tuple[str, list[str]]]:
    """Files of lib and share, by folder."""
    found: dict[str, list[str]] = {}
    for path in sorted([*files.glob("lib/**/*"), *files.glob("share/**/*")]):
        if path.is_file():
            relative = path.relative_to(files)
            found.setdefault(str(relative.parent), []).append(str(relative))
    return list(found.items())


if __name__ == "__main__":
    sys.exit(main())
