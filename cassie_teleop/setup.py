"""Build of cassie_teleop by colcon (ament_python)."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "cassie_teleop"

setup(
    name=NAME,
    version="0.1.0",
    description="Driving Cassie by radio, gamepad, keyboard, browser or script",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    url="https://example.org/cassie-ros2",
    license="Apache-2.0",
    maintainer="Cassie for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    packages=find_packages(exclude=["test"]),
    package_data={NAME: ["**/*.yaml", "**/*.md", "web/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "README.md"]),
        (f"share/{NAME}/config", sorted(map(str, Path("config").glob("*.yaml")))),
    ],
    zip_safe=False,
    python_requires=">=3.10",
    install_requires=[
        "aiohttp",
        "nicegui",
        "numpy",
        "pygame",
    ],
    extras_require={"test": ["playwright", "pytest", "pytest-timeout"]},
    entry_points={
        "console_scripts": [
            "rc_teleop = cassie_teleop.executables:rc_teleop",
            "doctor = cassie_teleop.executables:doctor",
            "cmd_vel = cassie_teleop.executables:cmd_vel",
            "joystick = cassie_teleop.executables:joystick",
            "keyboard_teleop = cassie_teleop.executables:keyboard_teleop",
            "scripted_operator = cassie_teleop.executables:scripted_operator",
            "web_console = cassie_teleop.executables:web_console",
        ],
    },
)
