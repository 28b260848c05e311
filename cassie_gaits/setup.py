"""Build of cassie_gaits by colcon (ament_python)."""

from setuptools import find_packages, setup

NAME = "cassie_gaits"

setup(
    name=NAME,
    version="0.1.0",
    description="Model of Cassie for control: names, geometry, outputs, dynamics, gait library",
    license="Apache-2.0",
    maintainer="Cassie for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    packages=find_packages(exclude=["test"]),
    package_data={NAME: ["**/*.json", "**/*.json.gz", "**/*.yaml", "**/*.md"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "optimize_gaits = cassie_gaits.ros.optimize_gaits:main",
            "check_gaits = cassie_gaits.ros.check_gaits:main",
            "plot_gaits = cassie_gaits.ros.plot_gaits:main",
        ],
    },
)
