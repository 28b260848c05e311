"""Build of cassie_bags by colcon (ament_python)."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "cassie_bags"

setup(
    name=NAME,
    version="0.1.0",
    description="Recording, recovery, replay and experiments with Cassie",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    url="https://example.org/cassie-ros2",
    license="Apache-2.0",
    maintainer="Cassie for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    packages=find_packages(exclude=["test"]),
    package_data={NAME: ["**/*.html", "**/*.json", "**/*.yaml", "**/*.md"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "README.md", "RESULTS.md", "fingerprints.yaml"]),
        (f"share/{NAME}/experiments", sorted(map(str, Path("experiments").glob("*.yaml")))),
    ],
    zip_safe=False,
    python_requires=">=3.10",
    install_requires=[
        "cma",
        "distributed",
        "aiohttp",
        "jinja2",
        "matplotlib",
        "mcap",
        "mujoco",
        "numpy",
        "pillow",
        "pyarrow",
        "PyYAML",
        "rosbags",
        "tqdm",
        "zstandard",
    ],
    extras_require={
        "lz4": ["lz4==4.4.5"],
        "test": ["pytest", "pytest-timeout"],
    },
    entry_points={
        "console_scripts": [
            "cassie_bags = cassie_bags.executables:cassie_bags",
            "record = cassie_bags.executables:record",
            "robot = cassie_bags.executables:robot",
            "replay = cassie_bags.executables:replay",
            "recover = cassie_bags.executables:recover",
            "experiment = cassie_bags.executables:experiment",
            "fingerprint = cassie_bags.executables:fingerprint",
            "faults = cassie_bags.executables:faults",
            "failsafes = cassie_bags.executables:failsafes",
            "learn_torques = cassie_bags.executables:learn_torques",
            "return_map = cassie_bags.executables:return_map",
            "sweep = cassie_bags.executables:sweep",
            "tune = cassie_bags.executables:tune",
            "info = cassie_bags.executables:info",
            "plot = cassie_bags.executables:plot",
            "compare = cassie_bags.executables:compare",
            "report = cassie_bags.executables:report",
            "export = cassie_bags.executables:export",
        ],
    },
)
