"""One gait at a time: for which conditions, certified, the same each time, refused in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cassie_gaits.certificate.certify import certify
from cassie_gaits.certificate.seal import flaw, gait_sha256
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library_file import library_path, load_library
from cassie_gaits.gait_message import conditions_of, gait_message
from cassie_gaits.optimize import single
from cassie_gaits.optimize.single import Conditions, GaitMaker, Result
from cassie_msgs.layout import GaitRequest, GaitResult

LIBRARY = load_library(library_path("optimized"))
LOADED = Conditions(0.4, 0.0, 0.0, 8.0, 0.08)


@pytest.fixture(scope="module")
def maker():
    return GaitMaker(LIBRARY)


@pytest.fixture(scope="module")
def loaded(maker):
    return maker.make(LOADED)


def holds(gait):
    try:
        return certify(gait).met
    except GaitLibraryError:  # its motion breaks off
        return False


def test_a_gait_for_a_payload_on_a_slope_is_certified_for_just_that(loaded):
    assert loaded.result is Result.FOUND
    gait = loaded.gait
    assert flaw(gait, gait_sha256(gait)) == ""
    assert certify(gait).met
    for other in ({"payload": 0.0}, {"slope": 0.0}):
        request = {**gait.solver["request"], **other}
        assert not holds(replace(gait, solver={**gait.solver, "request": request}))


def test_payload_costs_what_gravity_asks(maker, loaded):
    level = maker.make(replace(LOADED, payload=0.0))
    ratio = (32.0 + 8.0) / 32.0
    assert ratio < loaded.gait.cost / level.gait.cost < ratio**2.5


def test_the_answer_depends_on_the_conditions_alone(maker, loaded):
    maker.make(Conditions(-0.3, 0.0, 0.0, 0.0, 0.0))
    again = maker.make(LOADED)
    np.testing.assert_array_equal(again.gait.coefficients, loaded.gait.coefficients)


def test_conditions_are_rounded_so_that_noise_asks_for_the_same_gait():
    noisy = Conditions(0.4013, -0.0004, 0.0, 7.9, 0.0812)
    assert noisy.rounded() == Conditions(0.4, 0.0, 0.0, 8.0, 0.08)


def test_an_estimated_payload_below_0_asks_for_no_payload():
    request = GaitRequest()
    request.floats[:] = (0.4, 0.0, 0.0, -1.2, 0.0)
    assert conditions_of(request) == Conditions(0.4, 0.0, 0.0, 0.0, 0.0)
    request.floats[3] = np.nan
    assert np.isnan(conditions_of(request).payload)


def test_a_robot_that_turns_on_a_slope_gets_a_gait_straight_ahead():
    """It was refused, and the robot fell from the gait for 1.8 m/s to one for 1 m/s."""
    request = GaitRequest()
    request.vx[...], request.yaw_rate[...], request.slope[...] = 0.4, 0.2, 0.06
    assert conditions_of(request).rounded() == Conditions(0.4, 0.0, 0.0, 0.0, 0.06)
    request.slope[...] = 0.004
    assert conditions_of(request).rounded() == Conditions(0.4, 0.0, 0.2, 0.0, 0.0)


@pytest.mark.parametrize(
    ("conditions", "words"),
    [
        (Conditions(0.3, 0.0, 0.3, 0.0, 0.1), "do not turn"),
        (Conditions(float("nan"), 0.0, 0.0, 0.0, 0.0), "vx is nan"),
        (Conditions(9.0, 0.0, 0.0, 0.0, 0.0), "vx is 9 m/s, expected"),
        (Conditions(0.0, 0.0, 0.0, 80.0, 0.0), "payload is 80"),
        (Conditions(0.0, 0.0, 0.0, -5.0, 0.0), "payload is -5 kg, expected 0 .. 30 kg"),
        (Conditions(0.0, 0.0, 0.0, float("nan"), 0.0), "payload is nan"),
        (Conditions(0.0, 0.0, 0.0, 1e308, 0.0), "payload is 1e+308 kg, expected 0 .. 30 kg"),
        (Conditions(-1e308, 0.0, 0.0, 0.0, 0.0), "vx is -1e+308 m/s, expected -5 .. 5 m/s"),
        (Conditions(0.0, 0.0, 1e308, 0.0, 0.0), "yaw_rate is 1e+308 rad/s, expected -3 .. 3 rad/s"),
        (Conditions(0.0, 0.0, 0.0, 0.0, -1e308), "slope is -1e+308 rad, expected -1 .. 1 rad"),
        (Conditions(0.0, 1e306, 0.0, 0.0, 0.0), "vy is 1e+306 m/s, expected -2 .. 2 m/s"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_words(maker, conditions, words):
    answer = maker.make(conditions)
    assert answer.result is Result.REFUSED
    assert answer.gait is None
    assert words in answer.reason


def test_what_the_solver_does_not_find_is_told(maker):
    answer = maker.make(Conditions(4.5, 0.0, 0.0, 0.0, 0.0))
    assert answer.result is Result.NOT_FOUND
    assert "no gait found in " in answer.reason


def test_what_is_not_certified_is_no_gait(maker, monkeypatch):
    def broken(gait):
        raise GaitLibraryError("integration broke off")

    monkeypatch.setattr(single, "certify", broken)
    answer = maker.make(Conditions(0.5, 0.0, 0.0, 0.0, 0.0))
    assert (answer.result, answer.gait) == (Result.NOT_CERTIFIED, None)
    assert answer.reason == "not certified: integration broke off"


def test_the_message_says_what_the_gait_is_for(maker, loaded):
    request = GaitRequest()
    request.episode[...], request.seq[...], request.effective_seq[...] = 3, 500, 750
    request.floats[:] = (0.4, 0.0, 0.0, 8.2, 0.081)
    assert conditions_of(request).rounded() == LOADED
    message = gait_message(request, loaded)
    assert (int(message.episode), int(message.seq), int(message.effective_seq)) == (3, 500, 750)
    assert (float(message.payload), float(message.slope)) == (8.0, 0.08)
    np.testing.assert_array_equal(message.right_stance, loaded.gait.coefficients[0].ravel())
    np.testing.assert_array_equal(message.left_stance, loaded.gait.coefficients[1].ravel())
    refused = gait_message(request, maker.make(Conditions(0.3, 0.0, 0.3, 0.0, 0.1)))
    assert int(refused.result) == GaitResult.REFUSED
    assert not np.any(refused.floats)


def test_results_are_those_of_the_message():
    assert {r.name: int(r) for r in Result} == {r.name: int(r) for r in GaitResult}


def test_a_library_without_gaits_of_this_optimizer_is_refused():
    gaits = tuple(replace(gait, passive=None, certificate=None) for gait in LIBRARY.gaits)
    with pytest.raises(GaitLibraryError, match="no gait of this optimizer"):
        GaitMaker(replace(LIBRARY, gaits=gaits))
