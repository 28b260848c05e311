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
        "PyYAML",
        "rosbags",
        "tqdm",
        "zstandard",
    ],
    extras_require={
        "lz4": ["lz4==4.4.5"],
        "parquet": ["pyarrow==26.0.1"],
        "test": ["pytest", "pytest-timeout"],
    },
    entry_points={
        "console_scripts": [
            "cassie_bags = cassie_bags.__main__:main",
            "record = cassie_bags.cli.record:main",
            "robot = cassie_bags.cli.robot:main",
            "replay = cassie_bags.cli.replay:main",
            "recover = cassie_bags.cli.recover:main",
            "experiment = cassie_bags.cli.experiment:main",
            "estimators = cassie_bags.cli.estimators:main",
            "fingerprint = cassie_bags.cli.fingerprint:main",
            "faults = cassie_bags.cli.faults:main",
            "failsafes = cassie_bags.cli.failsafes:main",
            "learn_torques = cassie_bags.cli.learn_torques:main",
            "return_map = cassie_bags.cli.return_map:main",
            "sweep = cassie_bags.cli.sweep:main",
            "tune = cassie_bags.cli.tune:main",
            "info = cassie_bags.cli.info:main",
            "plot = cassie_bags.cli.plot:main",
            "compare = cassie_bags.cli.compare:main",
            "report = cassie_bags.cli.report:main",
            "export = cassie_bags.cli.export:main",
        ],
    },
)
