"""Leg-angle adjustment: where and when the swing foot lands, so that the robot keeps its speed.

`PendulumPlacement` predicts with a pendulum; the paper's own law is `paper`. Both give
the swing leg at the end of the step; the walking controller fades it in over the step.
"""

from __future__ import annotations

from cassie_control.config import WalkConfig
from cassie_control.control.robot import LegReadings, Readings
from cassie_control.planner.momentum import AngularMomentum
from cassie_control.planner.paper import PaperPlacement
from cassie_control.planner.pendulum import Law, landing
from cassie_control.planner.plan import Commanded, Placement, StepAhead, SwingEnd

_LEAD_SPEED = 1.5  # m/s, fore or aft, up to which the swing foot's contact leads by more
_STEADY = 0.1  # m/s by which the command may change in two steps before nothing is summed up
_SUM_SPEED = 0.2  # m/s, error of a step's mean speed that counts at most


_CONFIGURED = tuple(name for name in Law.TYPE.names or () if not name.startswith("sum"))


def placement(config: WalkConfig) -> Placement:
    """The law that the configuration names."""
    return PaperPlacement(config) if config.as_in_paper else PendulumPlacement(config)


class PendulumPlacement:
    """Foot placement by the step-to-step map of a pendulum of constant height.

    After a touchdown the weight goes over to the new foot within `double_support` (t), during
    which the CoM coasts; then it falls away from the stance toe joint for the rest of the step,
    T. With x, v the CoM's position and velocity against the toe joint and w = sqrt(g / height),
    the velocity at touchdown v_end follows from

        v' = w x sinh(w T) + v cosh(w T).

    A foot set down u ahead of the CoM turns that velocity, one step later, into

        v_next = v_end cosh(w T) - w (u - v_end t) sinh(w T).

    In steady walking at speed s, with L = s (t + T) of ground a step,
    v_steady = L / (t + 2/w tanh(w T / 2)) and u_steady = v_steady (t + 1/w tanh(w T / 2)).
    Sideways the CoM also swings from foot to foot, W apart: the same with coth in the place of
    tanh and W in the place of L, towards the swing foot. The foot goes to

        u = u_steady + gain (v_end - v_steady) (t + coth(w T) / w) + sum,

    so that `gain` = 1 removes the error in one step; forward and backward walking have gains of
    their own. The robot's own map from step to step, v_next = a v_end - b u, found by feet set down
    at random beside the law's, asks for a gain a / b that is 1.07 of the pendulum's in place, 0.8
    at 0.5 m/s, 0.6 at 1 m/s and 0.5 at 1.6 m/s (sideways 1.07, 0.98, 0.9, 0.84): at speed a
    longer step brakes by its impact too. With all of it long and short steps alternate, and the
    step that catches a push throws it back. So the gains fall with the low-passed speed forward,
    by `pendulum_fade_x` and `_y` for each m/s; the sagittal ones with v_end where that is faster,
    backward as well, by as much as it is faster. `pendulum_gain_still` is added in place; not
    after a push. Fast, fore or aft, the foot also meets the ground earlier before the end of the
    step, by `contact_lead_speed`. Feet also go farther by `sidestep` and by `step_ahead`, less
    `step_ahead_fast` for each m/s, times the commanded speed: as that map has it, they land too
    close to the CoM by the pendulum.

    `sum` adds up the error of each step's mean speed, against the command in the mean of those two
    steps, bounded: it takes out what the pendulum leaves out.

    The foot stays within the swing leg's reach and apart from the stance foot. Where that bends
    the law, or where it wants the foot farther out than `easy_lean` of the CoM's height, the step
    ends sooner or later, within `quickest_step` and `slowest_step`, at the time
    at which the foot comes nearest to what the law wants (`pendulum.touchdown_time`). Under way, of
    what then lies beyond `far_lean` of that height, where smooth ground may not bear the foot, it
    goes `far_share`, `far_most` short of it at most: held back more, the speed to that side would
    grow from step to step. In place and in steps that recover from a push while standing it needs
    the foot there at once, and drives that act late sway too widely (`LateGains.placement`). The
    leg gets the length at which the foot meets the ground there, on the slope that the feet found.

    Assumes a stance foot that gives no torque and a CoM at constant height.
    """

    def __init__(self, config: WalkConfig) -> None:
        self._masses = AngularMomentum().records
        self._law = Law()
        self.config = config
        self.reset()

    @property
    def config(self) -> WalkConfig:
        """Gains; new ones hold from the next tick on."""
        return self._config

    @config.setter
    def config(self, config: WalkConfig) -> None:
        self._config = config
        for name in _CONFIGURED:
            setattr(self._law, name, getattr(config, name))

    def reset(self) -> None:
        """Forget the sums."""
        self._law.sum_x = self._law.sum_y = 0.0
        self._commanded: tuple[tuple[float, float], tuple[float, float]] | None = None

    def touchdown(
        self,
        mean_velocity: tuple[float, float],
        velocity: tuple[float, float],
        commanded: Commanded,
    ) -> None:
        """Add the mean velocity's error to the sums. In m/s."""
        c = self.config
        now = commanded.vx, commanded.vy
        before, earlier = self._commanded or (now, now)
        self._commanded = now, before
        # The velocity's mean is of two steps: so is the command's, or each change would add up.
        vx, vy = (0.25 * (a + 2.0 * b + c) for a, b, c in zip(now, before, earlier, strict=True))
        # What it lacks while it is told to go faster would be too much once it is there.
        steady = max(0.0, 1.0 - abs(now[0] - earlier[0]) / _STEADY)
        law = self._law
        law.sum_x = _summed(law.sum_x, steady * c.integral_x, mean_velocity[0] - vx, c)
        law.sum_y = _summed(law.sum_y, c.integral_y, mean_velocity[1] - vy, c)

    def swing_end(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        commanded: Commanded,
        ahead: StepAhead,
    ) -> SwingEnd:
        """Swing leg at touchdown; arguments as in `Placement.swing_end`."""
        lead = _lead(self._config, ahead.velocity[0])
        roll, pitch, length, remaining = landing(
            self._law.records,
            readings.records,
            self._masses,
            swing.number,
            ahead.records,
            commanded.records,
            lead,
        )
        return SwingEnd(pitch + commanded.pitch_trim, roll, length, remaining, lead)


def _lead(c: WalkConfig, speed: float) -> float:
    """Time from the swing foot's first contact to the end of the step, in s."""
    return c.contact_lead + c.contact_lead_speed * min(_LEAD_SPEED, abs(speed))


def _summed(total: float, gain: float, error: float, c: WalkConfig) -> float:
    """A sum, in m, with the error of a step's mean speed (m/s) added."""
    error = max(-_SUM_SPEED, min(_SUM_SPEED, error))
    return max(-c.integral_limit, min(c.integral_limit, total + gain * error))
