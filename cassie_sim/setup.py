"""Build of cassie_sim by colcon (ament_python)."""

import sys
from importlib.util import find_spec
from pathlib import Path

from setuptools import find_packages, setup

NAME = "cassie_sim"


def meshes() -> list[str]:
    """Files of the robot's meshes, where the package example-robot-data is installed.

    None when colcon only asks which files there are: it expects all of them in the source folder.
    """
    cmeel = find_spec("cmeel")
    installs = "install_data" in sys.argv or "symlink_data" in sys.argv
    if not installs or cmeel is None or cmeel.origin is None:
        return []
    share = Path(cmeel.origin).parents[1] / "cmeel.prefix/share/example-robot-data"
    return sorted(map(str, share.glob("robots/cassie_description/meshes/*.stl")))


setup(
    name=NAME,
    version="0.1.0",
    description="Cassie in MuJoCo: robot, drives, sensors, grounds and gantry",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    url="https://example.org/cassie-ros2",
    license="Apache-2.0",
    maintainer="Cassie for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    packages=find_packages(exclude=["test"]),
    package_data={NAME: ["**/*.json", "**/*.yaml", "**/*.md", "**/*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "README.md"]),
        (f"share/{NAME}/config", ["config/cassie.rviz", "config/cassie.foxglove.json"]),
        (f"share/{NAME}/meshes", meshes()),
    ],
    zip_safe=False,
    python_requires=">=3.10",
    install_requires=[
        "example-robot-data",
        "imageio",
        "imageio-ffmpeg",
        "llvmlite",
        "mujoco",
        "numba",
        "numpy",
        "scipy",
    ],
    extras_require={"test": ["pytest", "pytest-timeout"]},
    entry_points={
        "console_scripts": [
            "simulator = cassie_sim.executables:simulator",
        ],
    },
)
