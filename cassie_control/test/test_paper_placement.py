"""Where the swing foot goes by the paper's own law: its figures."""

from __future__ import annotations

import pytest
from placements import StepAhead, swing_target
from robot_states import leg_joints, readings_of, state_of

from cassie_control.config import WalkConfig
from cassie_control.planner.paper import PaperPlacement
from cassie_control.planner.placement import Commanded

STEP_TIME = 0.4
LENGTH = 0.8
LEFT, RIGHT = 0, 1


@pytest.mark.parametrize("stance", [LEFT, RIGHT])
def test_the_papers_law_gives_its_known_answer(stance):
    config = WalkConfig(law="paper", paper_kd_x=0.25, paper_offset=0.04)
    law, readings = PaperPlacement(config), readings_of(state_of(leg_joints(), leg_joints()))
    law.touchdown((9.0, 9.0), (0.2, -0.1), Commanded())
    ahead = StepAhead(
        0.1,
        0.3,
        step_time=STEP_TIME,
        velocity=(0.5, 0.04),
        landing_pitch=0.11,
        landing_roll=0.02,
        landing_length=LENGTH,
    )
    commanded = Commanded(vx=0.4, vy=0.1, pitch_trim=0.01, roll_trim=-0.02)
    end = swing_target(law, readings, stance, commanded, ahead)
    d = 1.0 if stance == LEFT else -1.0
    pitch = 0.11 + 0.1 * (0.5 - 0.4) + 0.25 * (0.5 - 0.2) + 0.04 + 0.01
    roll = 0.02 + 0.4 * (0.04 - 0.1) + 0.35 * (0.04 + 0.1) + d * 0.1 * 0.5 - 0.02
    assert end.pitch == pytest.approx(pitch)
    assert end.roll == pytest.approx(roll)


@pytest.mark.parametrize(("speed", "narrowing"), [(-1.0, 0.0), (0.5, 0.05), (3.0, 0.1)])
def test_the_papers_narrowing_saturates(speed, narrowing):
    law, readings = (
        PaperPlacement(WalkConfig(law="paper")),
        readings_of(state_of(leg_joints(), leg_joints())),
    )
    ahead = StepAhead(0.1, 0.3, step_time=STEP_TIME, velocity=(speed, 0.0), landing_length=LENGTH)
    end = swing_target(law, readings, LEFT, Commanded(), ahead)
    assert end.roll == pytest.approx(narrowing)
