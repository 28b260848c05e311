"""The definition of a fall, and the time of a fall."""

from __future__ import annotations

import math

import numpy as np

from cassie_bags.bag.continuity import episodes, only_episode
from cassie_bags.bag.recording import Recording
from cassie_bags.errors import BagError
from cassie_bags.signals.track import Track, make_track

FALLEN_TILT = math.radians(60.0)
"""Tilt of the pelvis beyond which the robot has fallen. In rad."""

FALLEN_HEIGHT = 0.30
"""Height of the pelvis above the lowest sole below which the robot has fallen. In m."""


def fall_time(track: Track) -> float | None:
    """Time of the first fall, in robot time of its episode (s); None if the robot did not fall."""
    height = track.position[:, 2] - track.sole_height.min(axis=1)
    fallen = (track.upright < math.cos(FALLEN_TILT)) | (height < FALLEN_HEIGHT)
    return float(track.time[np.argmax(fallen)]) if fallen.any() else None


def falls(recording: Recording) -> dict[int, float] | None:
    """Time of the fall (s, of its episode) by episode.

    Returns:
        None if the recording has no true pose.
    """
    times: dict[int, float] = {}
    known = False
    for episode in episodes(recording):
        try:
            time = fall_time(make_track(only_episode(recording, episode)))
        except BagError:
            continue
        known = True
        if time is not None:
            times[episode] = time
    return times if known else None
