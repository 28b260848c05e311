"""Build of cassie_control by colcon (ament_python)."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "cassie_control"

setup(
    name=NAME,
    version="0.1.0",
    description="State estimator, gait-library controller and mode supervisor of Cassie",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    url="https://example.org/cassie-ros2",
    license="Apache-2.0",
    maintainer="Cassie for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    packages=find_packages(exclude=["test"]),
    package_data={NAME: ["**/*.json", "**/*.yaml", "**/*.md"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "README.md"]),
    ],
    zip_safe=False,
    python_requires=">=3.10",
    install_requires=[
        "numpy",
    ],
    extras_require={"test": ["pytest", "pytest-timeout"]},
    entry_points={
        "console_scripts": [
            "state_estimator = cassie_control.executables:state_estimator",
            "gait_controller = cassie_control.executables:gait_controller",
            "mode_supervisor = cassie_control.executables:mode_supervisor",
            "stack = cassie_control.executables:stack",
        ],
    },
)
