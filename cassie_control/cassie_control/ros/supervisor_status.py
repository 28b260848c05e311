"""The supervisor's status for people, on /cassie/supervisor_status."""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.qos import QoSProfile

from cassie_control.ros.operator_source import OperatorSource
from cassie_control.supervisor.status import SupervisorStatus
from cassie_msgs.layout import RobotState
from cassie_msgs.msg import SupervisorStatus as SupervisorStatusMessage

RATE = 10
"""Rate of the status, in robot time. In Hz."""

_HEARTBEAT = 1.0  # s of wall time; also while robot time is paused


class StatusTopic:
    """Publishes the status at `RATE` and at each change."""

    def __init__(self, node: Node, control_rate: int) -> None:
        self.publisher = node.create_publisher(
            SupervisorStatusMessage, "/cassie/supervisor_status", QoSProfile(depth=10)
        )
        self._logger = node.get_logger()
        self._period = max(1, control_rate // RATE)
        self._due = 0
        self._reported: tuple[object, ...] = ()
        self._mode = ""
        self._published = 0.0

    def follow(
        self,
        seq: int,
        status: SupervisorStatus,
        state: RobotState,
        operator: OperatorSource,
        faults: tuple[str, ...],
    ) -> None:
        """Publish if it is due, or if anything but a number in a reason has changed.

        Args:
            seq: Control tick of the state.
            status: Status of the supervisor.
            state: State that the supervisor has answered.
            operator: Source of the operator's command.
            faults: Faults of other nodes and of the operator, in words.
        """
        now = (
            *(status.mode, status.requested, status.faults, status.fallen, status.link, faults),
            *(operator.holder, operator.armed),
        )
        if now == self._reported and 0 <= seq - (self._due - self._period) < self._period:
            return
        self._due = seq + self._period
        self._reported = now
        self.publish(status, state, operator, faults)

    def is_due(self, now: float) -> bool:
        """Whether the heartbeat is due, by wall time."""
        return now - self._published >= _HEARTBEAT

    def publish(
        self,
        status: SupervisorStatus,
        state: RobotState,
        operator: OperatorSource,
        faults: tuple[str, ...],
    ) -> None:
        """Publish now.

        Args:
            status: Status of the supervisor.
            state: State that the supervisor has answered.
            operator: Source of the operator's command.
            faults: Faults of other nodes and of the operator, in words.
        """
        message = SupervisorStatusMessage(
            mode=status.mode.name.lower(),
            requested=status.requested.name.lower(),
            readiness=status.readiness,
            stand_readiness=status.stand,
            walk_readiness=status.walk,
            segway_readiness=status.segway,
            faults=[*status.faults, *(fault for fault in faults if fault not in status.faults)],
            fallen=status.fallen,
            link=status.link,
            armed=operator.armed,
            holder=operator.holder,
            operators=operator.others,
            missed_ticks=int(state.missed_ticks),
            late_ticks=int(state.late_ticks),
            longest_delay=float(state.longest_delay),
            missed_share=status.missed_share,
            episode=int(state.episode),
            seq=int(state.seq),
        )
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(state.stamp_ns, 10**9)
        message.header.frame_id = "base_link"
        self.publisher.publish(message)
        self._published = time.monotonic()
        if message.mode != self._mode:
            self._mode = message.mode
            self._logger.info(f"mode {self._mode}")
