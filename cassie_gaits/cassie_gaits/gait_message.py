"""Conversion of a made gait to a message, for the node and for runs in one process."""

from __future__ import annotations

from dataclasses import replace

from cassie_gaits.optimize.single import Answer, Conditions
from cassie_msgs.layout import Gait, GaitRequest


def conditions_of(request: GaitRequest) -> Conditions:
    """The conditions in a request.

    A negative payload, as from noise of an estimate, becomes 0. No gait turns on a slope: there the
    gait goes straight, and the controller alone turns.
    """
    conditions = Conditions(*request.floats.tolist())
    if conditions.payload < 0.0:
        conditions = replace(conditions, payload=0.0)
    if conditions.rounded().slope != 0.0:
        conditions = replace(conditions, yaw_rate=0.0)
    return conditions


def gait_message(request: GaitRequest, answer: Answer) -> Gait:
    """The answer to a request, as a message."""
    message = Gait()
    message.answer(request)
    message.effective_seq[...] = request.effective_seq
    message.result[...] = int(answer.result)
    if answer.gait is None:
        return message
    made = answer.conditions
    message.vx[...], message.vy[...], message.yaw_rate[...] = made.vx, made.vy, made.yaw_rate
    message.payload[...], message.slope[...] = made.payload, made.slope
    message.step_time[...] = answer.gait.step_time
    right, left = answer.gait.coefficients
    message.right_stance[:], message.left_stance[:] = right.ravel(), left.ravel()
    return message
