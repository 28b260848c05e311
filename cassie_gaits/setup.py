"""Build of cassie_gaits by colcon (ament_python)."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "cassie_gaits"

setup(
    name=NAME,
    version="0.1.0",
    description="Model of Cassie for control: names, geometry, outputs, dynamics, gait library",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    url="https://example.org/cassie-ros2",
    license="Apache-2.0",
    maintainer="Cassie for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    packages=find_packages(exclude=["test"]),
    package_data={NAME: ["**/*.json", "**/*.json.gz", "**/*.yaml", "**/*.md"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "README.md"]),
    ],
    zip_safe=False,
    python_requires=">=3.10",
    install_requires=[
        "casadi",
        "distributed",
        "matplotlib",
        "numba",
        "numpy",
        "pin",
        "scipy",
    ],
    extras_require={"test": ["pytest", "pytest-timeout"]},
    entry_points={
        "console_scripts": [
            "optimize_gaits = cassie_gaits.executables:optimize_gaits",
            "check_gaits = cassie_gaits.executables:check_gaits",
            "gait_optimizer = cassie_gaits.executables:gait_optimizer",
            "plot_gaits = cassie_gaits.executables:plot_gaits",
        ],
    },
)
