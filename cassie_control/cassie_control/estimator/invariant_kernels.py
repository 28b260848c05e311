"""One tick of the invariant estimator in one call of compiled code, after `read_legs`."""

from __future__ import annotations

from cassie_control.estimator.filter_kernels import RecordArray, filter_step
from cassie_control.estimator.fusion import read_pelvis
from cassie_control.estimator.sample_kernels import finish
from cassie_gaits.compiled import compiled


@compiled
def move(
    samples: RecordArray,
    states: RecordArray,
    pairs: RecordArray,
    bodies: RecordArray,
    filters: RecordArray,
    noises: RecordArray,
) -> bool:
    """The filter, and the state that follows from it; False where the filter has diverged.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        pairs: Legs as `read_legs` left them, `LegPair.record`. Shape (1,).
        bodies: The same, of `body_records.BODY_TYPE`. Shape (1,).
        filters: Of `filter_records.FILTER_TYPE`. Shape (1,).
        noises: Of `filter_records.NOISE_TYPE`. Shape (1,).
    """
    sample, state, pair, body = samples[0], states[0], pairs[0], bodies[0]
    filter_step(
        filters,
        noises,
        sample.angular_velocity,
        sample.linear_acceleration,
        body.attitude,
        body.arms,
        pair.states.foot_rotation,
        state.contact_probability,
    )
    if not read_pelvis(filters[0], noises[0], body, sample.angular_velocity, state):
        return False
    finish(state, pair, body, filters[0].rotation)
    return True
