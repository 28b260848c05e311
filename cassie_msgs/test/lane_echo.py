"""Answers every sensor sample with a command of the same seq; a repeat from the cache."""

from rclpy.node import Node

from cassie_msgs.layout import MotorCommand, Sensors, header
from cassie_msgs.ros import process
from cassie_msgs.ros.fast_lane import LanePublisher, LaneSubscription, LaneWaiter


class Echo(Node):
    """Second party of the lane's tests."""

    def __init__(self, stop: process.Stop) -> None:
        super().__init__("echo")
        self._stop = stop
        self._sensors = LaneSubscription(self, Sensors)
        self._commands = LanePublisher(self, MotorCommand)
        self._waiter = LaneWaiter(self, [self._sensors])
        stop.on_request(self._waiter.wake)

    def loop(self) -> None:
        """Answer until stopped; `torque[1]` counts the steps, which repeats do not."""
        sample, command = Sensors(), MotorCommand()
        last, reply = -1, b""
        while not self._stop.requested:
            if not self._waiter.wait(0.5) or not self._sensors.take(sample):
                continue
            raw = sample.to_bytes()
            if (seq := header(raw)[3]) != last:
                command.seq[...], last = seq, seq
                command.torque[0] = sample.drive_position[3]
                command.torque[1] += 1.0
                reply = command.to_bytes()
            self._commands.publish_raw(reply)


if __name__ == "__main__":
    process.run("echo", Echo)
