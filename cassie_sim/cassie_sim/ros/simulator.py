"""Node `simulator`: Cassie in MuJoCo, with the topics of the real robot."""

from __future__ import annotations

import time
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from cassie_gaits.compiled import load_kept
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.ros.about import About
from cassie_msgs.ros.claim import Claim, ClaimConfig
from cassie_msgs.ros.diagnostics import ERROR, OK, Diagnostics
from cassie_msgs.ros.parameters import declare, on_change
from cassie_msgs.ros.periodic import Periodic
from cassie_msgs.ros.process import Stop, run
from cassie_msgs.ros.scheduling import Scheduling
from cassie_sim.loop import SimulationLoop
from cassie_sim.plant import Plant
from cassie_sim.robot_urdf import INSTALLED_MESHES, robot_urdf
from cassie_sim.ros.lane import SimulatorLane
from cassie_sim.ros.services import Services
from cassie_sim.simulator_config import SimulatorConfig, scenario_of
from cassie_sim.video import Film, RenderError, frame_of
from cassie_sim.window import Window

_FLUSH = 1.0  # s; time-out at the end, for published messages to arrive


class Simulator(Node):
    """Parameters, topics and services around a `SimulationLoop`."""

    def __init__(self, stop: Stop) -> None:
        super().__init__("simulator")
        self.claim = Claim(self, "simulator")
        self._config = declare(self, SimulatorConfig())
        scenario = scenario_of(self._config)
        plant = self._make_plant(scenario)
        load_kept("cassie_sim")
        # The episode rises over restarts, too, so that other nodes notice them.
        plant.episode = int(time.time()) & 0xFFFFFFFF
        self._film = self._start_film(plant)
        self._window = None if self._config.headless else Window(plant.model, plant.data)
        self._film_period = max(1, round(self._config.control_rate / self._config.video_fps))
        self._diagnostics = Diagnostics(self)
        lane = SimulatorLane(
            self,
            self._config.control_rate,
            self._report,
            self._watch,
            scripted=self._config.scripted_operator,
            one_thread=bool(self._config.video) or not self._config.headless,
        )
        self._lane = lane
        lane.keep_awake = self._config.hurries
        self._loop = SimulationLoop(plant, lane, self._config, self._report)
        self._loop.requests.wake = lane.wake
        self._stop = stop
        stop.on_request(self._end_loop)
        Services(self, self._loop, self._make_plant)
        on_change(self, lambda: self._loop.config, self._set_config)
        self._describe_robot()
        Periodic(self, 1.0, self._report_progress)

    def loop(self) -> None:
        """Run until Ctrl-C or the end of the duration."""
        plant = self._loop.plant
        self.get_logger().info(
            f"episode {plant.episode}: {self._config.pacing}, {self._config.control_rate} Hz"
        )
        Scheduling(self.get_logger().warning).follow(self._config.pacing == "realtime")
        self._loop.run()
        if self._stop.requested:
            return
        self.get_logger().info(f"{self._loop.plant.time:g} s of robot time are over")
        self._lane.flush(_FLUSH)

    def close(self) -> None:
        """Finish the film and close the window."""
        if self._film is not None:
            self._film.close(soon=self._stop.requested)
        if self._window is not None:
            self._window.close()

    def _make_plant(self, scenario: Scenario) -> Plant:
        pictures = bool(self._config.video) or not self._config.headless
        return Plant(self._config, scenario, meshes=pictures)

    def _start_film(self, plant: Plant) -> Film | None:
        if not self._config.video:
            return None
        try:
            return Film(plant.model, Path(self._config.video), self._config.video_fps)
        except RenderError as error:
            self.get_logger().error(f"no video: {error}")
            return None

    def _watch(self, plant: Plant) -> None:
        if self._film is not None and plant.seq % self._film_period == 0:
            self._film.snap(frame_of(plant.data))
        if self._window is not None:
            self._window.show(plant.model, plant.data, time.monotonic())

    def _report(self, condition: str, problem: str | None) -> None:
        if problem is None:
            self._diagnostics.set(condition, OK, "ok")
        else:
            self._diagnostics.set(condition, ERROR, problem)

    def _report_progress(self) -> None:
        loop = self._loop
        self._diagnostics.set(
            "loop",
            OK,
            "paused" if loop.paused else "running",
            episode=loop.plant.episode,
            tick=loop.plant.seq,
            real_time_factor=f"{loop.factor.value:.3f}",
            lockstep_broken=loop.times_broken,
            pacing=self._config.pacing,
            missed_ticks=loop.timing.missed,
            late_ticks=loop.timing.late,
            longest_delay=f"{loop.timing.longest_delay:.4f}",
        )

    def _set_config(self, config: SimulatorConfig) -> None:
        self._loop.config = config
        self._lane.keep_awake = config.hurries

    def _end_loop(self) -> None:
        self._loop.stop()
        self._lane.wake()

    def _describe_robot(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._description = self.create_publisher(String, "/robot_description", latched)
        self._description.publish(String(data=robot_urdf(_installed_meshes())))


def _installed_meshes() -> str | None:
    """URI of the meshes' folder, or None if there were no meshes when this package was built."""
    try:
        folder = Path(get_package_share_directory("cassie_sim"), "meshes")
    except PackageNotFoundError:
        return None
    return INSTALLED_MESHES if folder.is_dir() else None


ABOUT = About(
    package="cassie_sim",
    text="Cassie in MuJoCo with the topics of the real robot. By default it hangs in the gantry "
    "and waits for power. Services reset, pause and push, and move the gantry. "
    "In scene segway it also has the topics /segway and the service /cassie/hold_bar.",
    reads=("/cassie/motor_command", "/cassie/operator_command"),
    writes=(
        "/cassie/sensors",
        "/cassie/ground_truth",
        "/clock",
        "/joint_states",
        "/robot_description",
        "/segway/ground_truth",
        "/segway/imu",
        "/diagnostics",
    ),
    services=(
        "/cassie/reset",
        "/cassie/pause",
        "/cassie/step",
        "/cassie/push",
        "/cassie/gantry",
        "/cassie/hold_bar",
    ),
    parameters=(SimulatorConfig(), ClaimConfig()),
)


def main() -> None:
    """Entry point of `ros2 run cassie_sim simulator`."""
    run("simulator", Simulator, ABOUT)


if __name__ == "__main__":
    main()
