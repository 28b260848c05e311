"""Which page drives, when its link is lost, and what is asked of the robot then."""

import math

import pytest

from cassie_msgs.operators import RIDE_STOP
from cassie_teleop.console import GRANT_TIME, LAPSE, LINK_AGE, STOP_TIME, Console, Reach
from cassie_teleop.page_messages import Beat, Press, Slide, Sticks

OWN = "web_console-7"


class Pages:
    """A console with pages whose frames reach them at once, and their time."""

    def __init__(self, *pages):
        self.console = Console(OWN, Reach())
        self.now = 100.0
        for page in pages:
            self.console.join(page, f"page {page}")

    def press(self, page, button, age=0.0):
        return self.console.hear(page, Press(self.now - age, button), self.now)

    def beat(self, page, forward=0.0, left=0.0, turn=0.0, visible=True, age=0.0):
        sticks = Sticks(forward, left, turn)
        return self.console.hear(page, Beat(self.now - age, visible, sticks), self.now)

    def request(self, after=0.0):
        self.now += after
        return self.console.request(self.now)


def driving(*others, mode="walk"):
    """Page 1 drives, with power."""
    pages = Pages(1, *others)
    pages.press(1, "drive")
    pages.press(1, "power")
    pages.console.follow_power(True)
    pages.press(1, mode)
    pages.beat(1)
    return pages


def test_nothing_is_said_before_a_page_drives_and_power_waits_for_its_button():
    pages = Pages(1)
    pages.beat(1, forward=1.0)
    assert pages.request() is None
    assert "Drive" in pages.press(1, "walk")
    pages.press(1, "drive")
    pages.beat(1)
    request = pages.request()
    assert (request.power, request.mode, request.vx, request.link) == (False, "stand", 0.0, True)
    pages.press(1, "power")
    assert pages.request().power


def test_while_a_page_drives_no_other_page_records():
    pages = driving(2)
    assert pages.press(2, "record") == "page 1 drives"
    assert not pages.console.orders
    assert pages.press(1, "record") == "" and list(pages.console.orders) == ["record"]
    pages.press(1, "leave")
    assert pages.press(2, "record") == ""  # a robot that nobody drives by a page, or a replay


def test_power_asked_for_again_while_it_is_on_does_not_stop_a_walk():
    pages = driving()
    pages.beat(1, forward=1.0)
    pages.press(1, "power")  # a second click, late by a slow link
    assert (pages.request().mode, pages.request().vx > 0.0) == ("walk", True)


def test_sticks_drive_while_they_are_held_and_letting_go_is_stop():
    pages = driving()
    pages.beat(1, forward=1.0, left=-1.0, turn=0.5)
    request = pages.request()
    assert (request.vx, request.vy, request.yaw_rate) == (0.8, -0.25, 0.3)
    pages.beat(1, forward=-1.0)
    assert pages.request().vx == -0.4
    pages.beat(1)
    request = pages.request()
    assert (request.vx, request.vy, request.yaw_rate, request.mode) == (0, 0, 0, "walk")


def test_sticks_count_only_once_they_were_at_rest_in_the_mode():
    pages = driving(mode="stand")
    pages.beat(1, forward=1.0)
    assert pages.request().vx == 0.0
    pages.press(1, "walk")
    pages.beat(1, forward=1.0)
    assert pages.request().vx == 0.0 and not pages.console.armed
    pages.beat(1)
    pages.beat(1, forward=1.0)
    assert pages.request().vx == 0.8
    pages.press(1, "walk")
    assert pages.request().vx == 0.8


def test_on_a_segway_the_sticks_lean():
    pages = driving(mode="segway")
    pages.console.hear(1, Slide(pages.now, "com_x", 0.08), pages.now)
    pages.beat(1, forward=1.0, turn=-1.0)
    request = pages.request()
    assert (request.com_x, request.com_y, request.vx, request.yaw_rate) == (0.1, -0.05, 0, 0)
    pages.beat(1)
    assert (pages.request().com_x, pages.request().com_y) == (0.08, 0)


@pytest.mark.parametrize("how", ["silent", "hidden", "frames late", "messages late"])
def test_a_page_that_is_silent_hidden_or_late_has_no_link_and_moves_nothing(how):
    pages = driving()
    pages.beat(1, forward=1.0)
    assert pages.request().vx == 0.8
    if how == "silent":
        pages.now += LINK_AGE + 0.001
    elif how == "hidden":
        pages.beat(1, forward=1.0, visible=False)
    else:  # it goes on to talk, but of frames that are ever older
        for _ in range(20):
            pages.now += 0.033
            pages.beat(1, forward=1.0, age=(pages.now - 100.0) + 0.05)
    request = pages.request()
    assert (request.link, request.vx, request.power) == (False, 0.0, True)
    pages.beat(1, forward=1.0)
    request = pages.request()
    assert (request.link, request.vx) == (True, 0.0)  # the stick was not let go


def test_just_within_the_time_the_link_is_good():
    pages = driving()
    pages.beat(1, forward=1.0)
    assert pages.request(after=LINK_AGE - 0.001).vx == 0.8


def test_a_short_loss_keeps_the_mode_and_a_long_one_asks_for_it_anew():
    for loss, mode in ((LAPSE - 0.1, "walk"), (LAPSE + 0.1, "stand")):
        pages = driving()
        pages.request()
        pages.request(after=loss)
        pages.beat(1)
        assert pages.request().mode == mode


def test_a_message_from_the_future_proves_no_link():
    pages = driving()
    pages.console.hear(1, Beat(pages.now + 1e6, True, Sticks(1.0)), pages.now)
    assert not pages.request(after=LINK_AGE + 0.01).link


def test_a_button_that_comes_too_late_does_nothing_except_for_the_stop():
    pages = driving()
    assert "late" in pages.press(1, "segway", age=LINK_AGE + 0.01)
    assert pages.request().mode == "walk"
    pages.press(1, "stop", age=60.0)
    assert pages.request().emergency_stop


def test_a_second_page_looks_on_and_is_told_who_drives():
    pages = driving(2)
    pages.beat(2, forward=1.0)
    told = [pages.press(2, button) for button in ("walk", "power", "reset", "leave", "neutral")]
    told.append(pages.console.hear(2, Slide(pages.now, "height", 0.5), pages.now))
    assert all("page 1 drives" in words for words in told)
    assert "page 1 drives" in pages.press(2, "drive")
    request = pages.request()
    assert (request.vx, request.height, request.mode, pages.console.driver) == (0.0, 0.9, "walk", 1)
    assert not pages.console.orders


def test_a_page_takes_over_at_rest_with_the_power_as_it_was():
    pages = driving(2)
    pages.press(1, "stand")
    pages.beat(1, forward=0.3)
    assert "page 1 drives" in pages.press(2, "drive")  # a stick is moved
    pages.beat(1)
    assert pages.press(2, "drive") == ""
    pages.beat(2)
    pages.beat(1, forward=1.0)
    request = pages.request()
    assert (pages.console.driver, request.power, request.vx, request.mode) == (
        2,
        True,
        0.0,
        "stand",
    )
    assert "page 2" in pages.console.notice


def test_a_page_takes_over_from_one_whose_link_is_lost():
    pages = driving(2)
    pages.now += LINK_AGE + 0.1
    pages.beat(2)
    assert pages.press(2, "drive") == "" and pages.console.driver == 2


@pytest.mark.parametrize("how", ["leave", "closed"])
def test_a_drive_ends_with_exactly_one_stop_and_then_silence(how):
    pages = driving()
    pages.beat(1, forward=1.0)
    pages.press(1, "leave") if how == "leave" else pages.console.leave(1)
    request = pages.request()
    assert (request.link, request.vx, request.mode, request.power) == (False, 0.0, "stand", True)
    assert pages.request() is None and pages.console.last_request() is None


def test_a_page_that_is_loaded_again_does_not_cut_the_power():
    pages = driving()
    pages.console.leave(1)
    pages.request()
    pages.console.join(2, "page 2")
    pages.press(2, "drive")
    pages.beat(2)
    assert pages.request().power
    pages.console.leave(2)
    pages.console.follow_power(False)
    pages.console.join(3, "page 3")
    pages.press(3, "drive")
    pages.beat(3)
    assert not pages.request().power


@pytest.mark.parametrize("page", [1, 2])
def test_every_page_stops_the_robot_and_power_comes_back_by_its_button_only(page):
    pages = driving(2)
    pages.beat(1, forward=1.0)
    pages.press(page, "stop")
    request = pages.request()
    assert (request.power, request.emergency_stop, request.vx, request.mode) == (
        False,
        True,
        0.0,
        "stand",
    )
    pages.beat(1)
    pages.request(after=0.2)
    pages.beat(1)
    pages.press(1, "walk")
    assert not pages.request().power
    pages.press(1, "power")
    request = pages.request()
    assert (request.power, request.emergency_stop, request.mode) == (True, False, "stand")


def test_a_page_that_looks_on_stops_the_robot_where_none_drives():
    pages = Pages(1)
    pages.press(1, "stop", age=5.0)
    assert pages.request().emergency_stop and pages.request(after=STOP_TIME - 0.1).emergency_stop
    assert pages.request(after=0.2) is None


def test_power_that_was_lost_is_asked_for_anew():
    pages = driving()
    pages.console.follow_power(False)
    request = pages.request()
    assert (request.power, request.mode, request.emergency_stop) == (False, "stand", False)


def test_power_that_was_refused_is_switched_off_and_on_by_the_button():
    pages = Pages(1)
    pages.press(1, "drive")
    pages.console.follow_power(False)
    pages.press(1, "power")
    pages.beat(1)
    assert pages.request().power
    pages.press(1, "power")
    assert not pages.request().power
    pages.now += 0.25
    pages.beat(1)
    assert pages.request().power


def test_power_of_a_robot_that_says_nothing_is_not_switched_off_by_the_power_button():
    pages = Pages(1)
    pages.press(1, "drive")
    for _ in range(2):
        pages.press(1, "power")
        pages.beat(1)
        assert pages.request().power


def test_no_page_takes_over_a_segway_that_brakes():
    pages = driving(2, mode="segway")
    pages.request()
    pages.press(1, "stand")
    pages.now += RIDE_STOP - 0.1
    pages.beat(1)
    pages.beat(2)
    assert "page 1 drives" in pages.press(2, "drive")
    pages.now += 0.2
    pages.beat(1)
    assert pages.press(2, "drive") == "" and pages.console.driver == 2


def test_a_new_episode_asks_for_stand():
    pages = driving()
    pages.console.disarm()
    assert pages.request().mode == "stand"


def test_the_lease_of_another_operator_is_asked_for_once_and_without_it_nothing_is_said():
    pages = Pages(1)
    pages.console.follow_lease("keyboard_teleop-3", pages.now)
    pages.press(1, "drive")
    pages.beat(1)
    assert pages.request().take_over
    pages.now += GRANT_TIME
    pages.beat(1)
    pages.console.follow_lease("keyboard_teleop-3", pages.now - 0.1)
    assert not pages.request().take_over
    pages.console.follow_lease("keyboard_teleop-3", pages.now + 0.1)
    assert pages.request() is None and pages.console.driver is None
    assert "keyboard_teleop-3 drives" in pages.console.notice


def test_the_own_lease_and_nobodys_are_kept():
    pages = driving()
    for holder in (OWN, ""):
        pages.now += 10.0
        pages.beat(1)
        pages.console.follow_lease(holder, pages.now)
        request = pages.request()
        assert request is not None and not request.take_over


def test_sliders_stay_within_their_ranges_and_go_back_all_at_once():
    pages = driving()
    for name, value, held in (("height", 99.0, 1.05), ("com_x", -1.0, -0.1), ("roll", 0.1, 0.1)):
        pages.console.hear(1, Slide(pages.now, name, value), pages.now)
        assert getattr(pages.request(), name) == held
    pages.press(1, "neutral")
    request = pages.request()
    assert (request.height, request.com_x, request.roll, request.mode) == (0.9, 0.0, 0.0, "walk")


def test_orders_of_the_page_that_drives_are_kept_for_the_simulator_within_bounds():
    pages = driving(2)
    pages.press(1, "lower")
    assert list(pages.console.orders) == ["lower"]
    for _ in range(1000):
        pages.press(1, "reset")
    assert len(pages.console.orders) <= 10


def test_the_node_ends_with_a_stop_if_a_page_drives():
    pages = driving()
    pages.beat(1, forward=1.0)
    request = pages.console.last_request()
    assert (request.link, request.vx, request.power) == (False, 0.0, True)
    assert Pages(1).console.last_request() is None


def test_no_number_that_a_stick_can_have_leaves_the_ranges():
    for forward in (-1.0, -0.0, 1e-300, 1.0):
        pages = driving()
        pages.beat(1, forward=forward)
        assert math.isfinite(pages.request().vx)
