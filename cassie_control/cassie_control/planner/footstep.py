"""Leg-angle adjustment: where and when the swing foot lands, so that the robot keeps its speed.

`PendulumPlacement` predicts with a pendulum (`pendulum`); the paper's own law is `paper`. Both give
the swing leg at the end of the step. The walking controller moves the leg's set-points there over
the step.
"""

from __future__ import annotations

from cassie_control.config import WalkConfig
from cassie_control.planner.momentum import Masses, make_masses
from cassie_control.planner.pendulum import PlacementGains
from cassie_control.planner.placement import Commanded, Placement
from cassie_gaits.records import Records

_MAX_OFFSET = 0.1  # m, saturation of the offset; steady walking needs up to 0.04 m
_FORGETTING_RATIO = 2.5  # of forgetting to learning rate beyond `observer_error`, of 1 to 3 tried
_MAP_ERROR = 0.3  # m/s, speed error in place that an offset of `_MAX_OFFSET` removes, by the map


class PendulumPlacement(Placement):
    """Foot placement by the step-to-step map of a pendulum of constant height (`plan_landing`).

    After a touchdown the weight shifts to the new foot within `double_support` (t). During this
    time the CoM keeps its velocity. Then it falls away from the stance toe joint until the swing
    foot's first contact, at T_rest, for a single support of T_1. With x, v the CoM's position and
    velocity relative to the toe joint and w = sqrt(g / height), the velocity at the contact is

        v_end = w x sinh(w T_1) + v cosh(w T_1).

    The foot meets the ground before the end of the step, by lead = `contact_lead` +
    `contact_lead_speed` |low-passed forward velocity|, up to 1.5 m/s. The next step then takes
    T' = step time - lead, with the single support T_ss = T' - t. A foot set down u ahead of the CoM
    turns v_end, one step later, into

        v_next = v_end cosh(w T_ss) - w (u - v_end t) sinh(w T_ss).

    v_s and u_s are v_end and u in steady walking at the commanded velocity v_c. Forward they are

        v_s = v_c T' / (t + 2/w tanh(w T_ss / 2)),    u_s = v_s (t + 1/w tanh(w T_ss / 2)).

    Sideways the CoM also sways from foot to foot, which are B apart (B > 0 if the left leg swings):

        q = B / (t + 2/w coth(w T_ss / 2))           is added to v_s,
        q (t + 1/w coth(w T_ss / 2))                 is added to u_s.

    The robot's own step-to-step map, v_next = a v_end - b u, was identified with random deviations
    of the feet from the law's footholds. The faster the robot walks, the more a foot farther ahead
    brakes it, compared with the pendulum. So b grows with the velocity at the coming contact, and

        a / b = map_gain / (1 + map_loss |v_end,x|) (t + coth(w T_ss) / w),

    with gain and loss of each axis. Steady walking and the step that catches a push have the same
    map. The foot removes the error in one step (forward a tenth less than identified, as an
    overshoot slips on smooth ground):

        u = u_s + a / b (v_end - v_s) - dv / b + d.

    dv turns the velocity with the heading. v_n, the steady velocity of the next touchdown, is
    planned in the next heading, and its sway is opposite. At a yaw rate r its components in the
    present heading are larger by

        dv = r T' (-v_n,y, v_n,x),    v_n = v_s - (0, 2 q),
        1 / b = map_gain / (1 + map_loss |v_s,x|) / (w sinh(w T_ss)).

    In steady walking the robot's foothold lies ahead of the pendulum's, by a cubic in the commanded
    speed (`pendulum.ahead_of_pendulum`), which is added to u_s.

    d is the offset of a disturbance observer. By the map, the mean speed of two steps is the mean
    of the commands for which their feet were placed. The difference is the map's error, and

        d <- d + observer_gain (mean speed - mean command).

    The growth of d saturates at an error of `observer_error`. A larger error comes from a force on
    the robot, not from the map, and does not last. d grows by less where no offset would remove the
    error (`_MAP_ERROR`). d shrinks by the whole error, and by the part beyond `observer_error` 2.5
    times as fast. Small errors of both signs count alike. Otherwise the mean speed would differ
    from the commanded one where errors alternate around an offset, as under a payload.

    Constraints: the foot stays within the swing leg's reach (a box about the hip) and apart from
    the stance foot. T_rest minimises

        max(distance of the law's foothold to these, outward u - friction height)^2
            + 0.2 (change of T_rest)^2

    within the quickest and the slowest step (`pendulum.contact_time`); it stays that of the gait
    while the first term is 0. At the phase s the foot, which has the way l left to go, needs

        T_rest + lead >= (1 - s) quickest_step + swing_time l.

    So the friction cone makes a step quicker and does not bound the foot. The leg gets the length
    at which the foot meets the ground there, on the estimated slope, plus `landing_depth`, plus
    lead slope . v_end, by which the hips climb until the end of the step.

    Assumes a stance foot that gives no torque and a CoM at constant height.

    Attributes:
        gains: For compiled functions, with the observer's state.
        masses: Masses of the robot, for compiled functions. Shape (1,).

    Source:
        README, Foot placement. Pendulum: Kajita et al., "The 3D Linear Inverted Pendulum Mode",
        IROS 2001. The paper's own law is `PaperPlacement`.
    """

    def __init__(self, config: WalkConfig) -> None:
        self.masses: Records[Masses] = make_masses()
        self.gains: PlacementGains = PlacementGains()
        super().__init__(config)

    def reset(self) -> None:
        """Reset the disturbance observer."""
        self.gains.offset_x = self.gains.offset_y = 0.0
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
        gains = self.gains
        gains.offset_x = _next_offset(gains.offset_x, mean_velocity[0] - vx, c)
        gains.offset_y = _next_offset(gains.offset_y, mean_velocity[1] - vy, c)


def _next_offset(offset: float, error: float, c: WalkConfig) -> float:
    """New offset of the observer, in m, after a step with the mean speed error `error` (m/s)."""
    growth = c.observer_gain * c.observer_error * _MAP_ERROR / max(_MAP_ERROR, abs(error))
    lower = max(-_MAX_OFFSET, min(offset, 0.0) - growth)
    upper = min(_MAX_OFFSET, max(offset, 0.0) + growth)
    if offset * error < 0.0:
        saturated = max(-c.observer_error, min(c.observer_error, error))
        error = saturated + _FORGETTING_RATIO * (error - saturated)
    return max(lower, min(upper, offset + c.observer_gain * error))
