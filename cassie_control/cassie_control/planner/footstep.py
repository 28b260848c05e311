"""Leg-angle adjustment: where and when the swing foot lands, so that the robot keeps its speed.

`PendulumPlacement` predicts with a pendulum; the paper's own law is `paper`. Both give the swing
leg at the end of the step. The walking controller moves the leg's set-points there over the step.
"""

from __future__ import annotations

from cassie_control.config import WalkConfig
from cassie_control.control.robot import LegReadings, Readings
from cassie_control.planner.momentum import AngularMomentum
from cassie_control.planner.paper import PaperPlacement
from cassie_control.planner.pendulum import PlacementGains, plan_landing
from cassie_control.planner.placement import Commanded, GaitStep, Placement, SwingTarget

_MAX_LEAD_SPEED = 1.5  # m/s forward or backward, saturation of `contact_lead_speed`
_MAX_OFFSET = 0.1  # m, saturation of the offset; steady walking needs up to 0.04 m
_FORGETTING_RATIO = 2.5  # of forgetting to learning rate, for errors beyond `observer_error`
_MAP_ERROR = 0.3  # m/s, speed error in place that an offset of `_MAX_OFFSET` removes, by the map


_FIELDS = PlacementGains.TYPE.names or ()
_CONFIG_FIELDS = tuple(name for name in _FIELDS if not name.startswith("offset"))


def make_placement(config: WalkConfig) -> Placement:
    """The law that the configuration names."""
    return PaperPlacement(config) if config.as_in_paper else PendulumPlacement(config)


class PendulumPlacement:
    """Foot placement by the step-to-step map of a pendulum of constant height.

    After a touchdown the weight shifts to the new foot within `double_support` (t). During this
    time the CoM keeps its velocity; then it falls away from the stance toe joint for the rest of
    the step, T. With x, v the CoM's position and velocity relative to the toe joint and
    w = sqrt(g / height), the velocity at touchdown v_end follows from

        v' = w x sinh(w T) + v cosh(w T).

    A foot set down u ahead of the CoM turns that velocity, one step later, into

        v_next = v_end cosh(w T) - w (u - v_end t) sinh(w T).

    In steady walking at speed s, with a step length L = s (t + T),
    v_steady = L / (t + 2/w tanh(w T / 2)) and u_steady = v_steady (t + 1/w tanh(w T / 2)).
    Sideways the CoM also sways from foot to foot, which are W apart. The same equations hold, with
    coth instead of tanh and W instead of L, towards the swing foot.

    The robot's own step-to-step map, v_next = a v_end - b u, was identified with random deviations
    of the feet from the law's footholds. Its ratio a / b is 1.07 of the pendulum's,
    t + coth(w T) / w, in place, 0.8 at 0.5 m/s, 0.6 at 1 m/s and 0.5 at 1.6 m/s (sideways 1.07,
    0.98, 0.9, 0.84): the faster the robot walks, the more a foot farther ahead brakes it, compared
    with the pendulum. So b grows with speed, and

        a / b = map_gain / (1 + map_loss |v_end,x|) (t + coth(w T) / w),

    with gain and loss of each axis. The speed is that of the coming touchdown: steady walking and
    the step that catches a push have the same map. The foot removes the error in one step. Forward
    it removes a tenth less, as an overshoot slips on smooth ground:

        u = u_steady + a / b (v_end - v_steady) + d.

    While the heading turns at a rate r, v_steady is commanded in the next touchdown's heading. It
    differs from v_steady turned by r T', the whole step's turn, by

        dv = r T' (-(v_steady,y less the sway), v_steady,x),    and    u -= dv / b.

    In steady walking the robot's foothold lies ahead of the pendulum's, by a cubic in the speed
    (`pendulum.ahead_of_pendulum`); at 1.8 m/s it lies 6 cm behind it.

    d is the offset of a disturbance observer. By the map, the mean speed of two steps is the mean
    of the commands for which their feet were placed. The difference is the map's error, and

        d <- d + observer_gain (mean speed - mean command).

    The growth of d saturates at an error of `observer_error`. A larger error comes from a force on
    the robot, not from the map. When that force ends, a foot placed against it would make the robot
    fall.
    d grows by less where no offset would remove the error (`_MAP_ERROR`). d shrinks by the whole
    error, and by the part beyond `observer_error` 2.5 times as fast. Small errors of both signs
    count alike. Otherwise the mean speed would differ from the commanded one where errors alternate
    around an offset, as under a payload.

    Constraints: the foot stays within the swing leg's reach (a box about the hip) and apart from
    the stance foot. If the law's foothold is outside, the step ends sooner or later, within
    `quickest_step` and `slowest_step`. Its time minimises the squared distance to the reach plus
    the weighted squared change of the time (`pendulum.touchdown_time`). The leg gets the length at
    which the foot meets the ground there, on the estimated slope. It is longer by as much as the
    hips climb until the end of the step, contact_lead slope . v. At speed, forward or backward, the
    foot meets the ground earlier before the end of the step, by `contact_lead_speed`.

    Assumes a stance foot that gives no torque and a CoM at constant height.
    """

    def __init__(self, config: WalkConfig) -> None:
        self._masses = AngularMomentum().records
        self._gains = PlacementGains()
        self.config = config
        self.reset()

    @property
    def config(self) -> WalkConfig:
        """Gains; new ones are used from the next tick on."""
        return self._config

    @config.setter
    def config(self, config: WalkConfig) -> None:
        self._config = config
        for name in _CONFIG_FIELDS:
            setattr(self._gains, name, getattr(config, name))

    def reset(self) -> None:
        """Reset the disturbance observer."""
        self._gains.offset_x = self._gains.offset_y = 0.0
        self._last_commands: list[tuple[float, float]] = []

    def touchdown(
        self,
        mean_velocity: tuple[float, float],
        velocity: tuple[float, float],
        commanded: Commanded,
    ) -> None:
        """Update the disturbance observer; arguments as in `Placement.touchdown`."""
        c = self.config
        # A foot acts one step later: the mean of two steps results from the last three commands.
        now = commanded.vx, commanded.vy
        previous = self._last_commands or 3 * [now]
        vx, vy = (
            0.25 * (oldest + 2.0 * middle + newest)
            for oldest, middle, newest in zip(*previous, strict=True)
        )
        self._last_commands = [*previous[1:], now]
        gains = self._gains
        gains.offset_x = _next_offset(gains.offset_x, mean_velocity[0] - vx, c)
        gains.offset_y = _next_offset(gains.offset_y, mean_velocity[1] - vy, c)

    def swing_target(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        commanded: Commanded,
        gait_step: GaitStep,
    ) -> SwingTarget:
        """Swing leg at touchdown; arguments as in `Placement.swing_target`."""
        contact_lead = _contact_lead(self._config, gait_step.velocity[0])
        roll, pitch, length, remaining = plan_landing(
            self._gains.records,
            readings.records,
            self._masses,
            swing.number,
            gait_step.records,
            commanded.records,
            contact_lead,
        )
        return SwingTarget(pitch + commanded.pitch_trim, roll, length, remaining, contact_lead)


def _contact_lead(c: WalkConfig, speed: float) -> float:
    """Time from the swing foot's first contact to the end of the step, in s."""
    return c.contact_lead + c.contact_lead_speed * min(_MAX_LEAD_SPEED, abs(speed))


def _next_offset(offset: float, error: float, c: WalkConfig) -> float:
    """New offset of the observer, in m, after a step with the mean speed error `error` (m/s)."""
    growth = c.observer_gain * c.observer_error * _MAP_ERROR / max(_MAP_ERROR, abs(error))
    lower = max(-_MAX_OFFSET, min(offset, 0.0) - growth)
    upper = min(_MAX_OFFSET, max(offset, 0.0) + growth)
    if offset * error < 0.0:
        saturated = max(-c.observer_error, min(c.observer_error, error))
        error = saturated + _FORGETTING_RATIO * (error - saturated)
    return max(lower, min(upper, offset + c.observer_gain * error))
