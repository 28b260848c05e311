"""Publishes modes of rising seq, one every 2 ms."""

import time

from rclpy.node import Node

from cassie_msgs.layout import Mode
from cassie_msgs.ros import process
from cassie_msgs.ros.fast_lane import LanePublisher


class Talker(Node):
    """Second party of tests that only listen."""

    def __init__(self, stop: process.Stop) -> None:
        super().__init__("talker")
        self._stop = stop
        self._modes = LanePublisher(self, Mode)

    def loop(self) -> None:
        """Talk until stopped."""
        mode = Mode()
        while not self._stop.requested:
            mode.seq[...] += 1
            self._modes.publish(mode)
            time.sleep(0.002)


if __name__ == "__main__":
    process.run("talker", Talker)
