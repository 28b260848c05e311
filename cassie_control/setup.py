"""Build of cassie_control by colcon (ament_python)."""

from setuptools import find_packages, setup

NAME = "cassie_control"

setup(
    name=NAME,
    version="0.1.0",
    description="State estimator, gait-library controller and mode supervisor of Cassie",
    license="Apache-2.0",
    maintainer="Cassie for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    packages=find_packages(exclude=["test"]),
    package_data={NAME: ["**/*.json", "**/*.yaml", "**/*.md"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "state_estimator = cassie_control.ros.state_estimator:main",
            "gait_controller = cassie_control.ros.gait_controller:main",
            "mode_supervisor = cassie_control.ros.mode_supervisor:main",
            "stack = cassie_control.ros.stack:main",
        ],
    },
)
