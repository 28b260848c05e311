"""Radio and gamepad: the channel map, dead band, latches, link and refusals."""

from pathlib import Path

import pytest

from cassie_teleop.device import AxisMap, DeviceError, read_device, with_buttons
from cassie_teleop.radio import Radio, RadioError, mapped
from cassie_teleop.receiver import Receiver

CONFIG = Path(__file__).parent.parent / "config"
CHANNELS = (
    *("LV", "LH", "RV", "RH", "S1", "S2", "LS", "RS"),
    *("SA", "SB", "SC", "SD", "SE", "SF", "SG", "SH"),
)


def taranis(**channels):
    """Channels of a Taranis with power on, sticks centred; the rest by name."""
    values = dict.fromkeys(CHANNELS, 0.0) | {"SA": 1.0, "SB": -1.0, "SC": -1.0} | channels
    return list(values.values())


@pytest.fixture
def radio():
    return Radio(read_device(CONFIG / "taranis_qx7.yaml"))


def test_known_answers_of_the_taranis(radio):
    request = radio.read(taranis(), [1, 1])
    assert (request.mode, request.power, request.link, request.height) == ("stand", True, True, 0.9)
    assert (request.vx, request.vy, request.yaw_rate, request.trims) == (0, 0, 0, (0, 0, 0, 0))
    request = radio.read(taranis(RV=1.0, RH=1.0, LH=-1.0, LS=-1.0, S1=1.0, SB=0.0), [1, 1])
    assert request.mode == "walk"
    assert (request.vx, request.vy, request.yaw_rate) == (1.0, -0.3, 0.8)
    assert request.height == pytest.approx(0.6) and request.trims[0] == pytest.approx(0.1)
    assert radio.read(taranis(RV=-1.0), [1, 1]).vx == -0.5


@pytest.mark.parametrize("position", [0.9, 0.0, -1.0])
def test_power_is_off_below_one(radio, position):
    assert not radio.read(taranis(SA=position), [1, 1]).power


@pytest.mark.parametrize("flags", [[0, 1], [1, 0], [0, 0]])
def test_both_flags_make_the_link(radio, flags):
    assert not radio.read(taranis(), flags).link


@pytest.mark.parametrize(
    ("axes", "buttons", "message"),
    [
        (taranis()[:8], [1, 1], "/joy has 8 axes, the device file says 16"),
        (taranis(), [], "/joy has 0 buttons, the device file says 2"),
        (taranis(RV=float("nan")), [1, 1], "axis 2 = nan is outside"),
        (taranis(RH=1.5), [1, 1], "axis 3 = 1.5 is outside"),
    ],
)
def test_bad_channels_are_refused(radio, axes, buttons, message):
    with pytest.raises(RadioError, match=message):
        radio.read(axes, buttons)


def test_the_dead_band_is_left_without_a_jump():
    axis_map = AxisMap(axis=0, scale=2.0, scale_negative=1.0, offset=0.1, dead_band=0.2)
    assert mapped(axis_map, 0.2) == mapped(axis_map, -0.2) == 0.1
    assert mapped(axis_map, 0.2001) == pytest.approx(0.1, abs=1e-3)
    assert mapped(axis_map, 1.0) == pytest.approx(2.1)
    assert mapped(axis_map, -1.0) == pytest.approx(-0.9)


def test_a_gamepad_says_nothing_until_power_is_pressed_and_moves_only_while_held():
    pad = Radio(read_device(CONFIG / "gamepad.yaml"))
    axes = [0.0, 1.0] + 6 * [0.0]

    def pressed(*numbers):
        return [int(i in numbers) for i in range(11)]

    assert pad.read(axes, pressed(4)) is None
    request = pad.read(axes, pressed(7))
    assert request.power and request.vx == 0.0 and request.mode == "stand"
    pad.read(axes, pressed(3))
    request = pad.read(axes, pressed(4))
    assert request.mode == "walk" and request.vx == 1.0
    assert pad.read(axes, pressed()).vx == 0.0
    assert not pad.read(axes, pressed(1, 7)).power, "off is stronger than on"


PADS = {  # device file, buttons it has, power on, walk
    "gamepad": (11, 7, 3),
    "xbox": (11, 7, 3),
    "ps4": (13, 9, 2),
    "ps5": (13, 9, 2),
}


def pad_channels(name, *pressed, vx=0.0, triggers=0.0):
    """What ROS's joy node sends of a pad: axes 2 and 5 are triggers."""
    count = PADS[name][0]
    axes = [0.0, vx, triggers, 0.0, 0.0, triggers, 0.0, 0.0]
    return axes, [int(i in pressed) for i in range(count)]


def walking_pad(name):
    """A pad with power on and walk asked for."""
    pad = Radio(read_device(CONFIG / f"{name}.yaml"))
    _, power, walk = PADS[name]
    pad.read(*pad_channels(name, power))
    pad.read(*pad_channels(name, walk))
    return pad


@pytest.mark.parametrize("name", PADS)
def test_each_pad_moves_only_while_its_enable_button_is_held(name):
    pad = walking_pad(name)
    assert pad.read(*pad_channels(name, vx=1.0)).vx == 0.0
    request = pad.read(*pad_channels(name, 4, vx=1.0))
    assert request.mode == "walk" and request.vx > 0.7 and request.power


@pytest.mark.parametrize("name", ["xbox", "ps4", "ps5"])
def test_the_turbo_button_alone_moves_faster_both_ways(name):
    pad = walking_pad(name)
    assert pad.read(*pad_channels(name, 5, vx=1.0)).vx == pytest.approx(1.5)
    assert pad.read(*pad_channels(name, 4, 5, vx=-1.0)).vx == pytest.approx(-0.75)
    assert pad.read(*pad_channels(name, 4, vx=1.0)).vx == pytest.approx(0.8)


@pytest.mark.parametrize("name", PADS)
def test_power_comes_back_in_stand_after_an_emergency_stop_in_walk(name):
    pad = walking_pad(name)
    _, power, walk = PADS[name]
    assert not pad.read(*pad_channels(name, 1)).power  # circle of ps4 and ps5
    pad.read(*pad_channels(name, walk))
    pad.read(*pad_channels(name))
    request = pad.read(*pad_channels(name, power))
    assert request.power and request.mode == "stand"


@pytest.mark.parametrize("name", ["xbox", "ps4", "ps5"])
def test_a_trigger_that_nobody_touched_yet_counts_as_at_rest(name):
    pad = walking_pad(name)
    assert pad.read(*pad_channels(name)).height == pytest.approx(0.9)
    assert pad.read(*pad_channels(name, triggers=-1.0)).height == pytest.approx(0.6)
    assert pad.read(*pad_channels(name, triggers=0.0)).height == pytest.approx(0.75)


def test_a_device_may_have_one_of_several_counts_of_buttons():
    pad = Radio(read_device(CONFIG / "xbox.yaml"))
    axes, buttons = pad_channels("xbox", 7)
    assert pad.read(axes, [*buttons, 0]).power
    with pytest.raises(RadioError, match="has 13 buttons, the device file says 11 or 12"):
        pad.read(axes, [*buttons, 0, 0])


def test_other_buttons_may_be_held_to_move(radio):
    device = with_buttons(read_device(CONFIG / "gamepad.yaml"), 9, -1)
    assert (device.enable_button, device.enable_turbo_button) == (9, None)
    with pytest.raises(DeviceError, match="enable_turbo_button = 11: no such button"):
        with_buttons(device, -1, 11)


def test_release_of_the_enable_button_is_told_at_once_and_once():
    receiver = Receiver(walking_pad("xbox"), 0.5)
    receiver.receive(*pad_channels("xbox"), 1.0)
    assert not receiver.receive(*pad_channels("xbox", 4, vx=1.0), 1.1)
    assert receiver.receive(*pad_channels("xbox", vx=1.0), 1.2), "the stop"
    request = receiver.request(1.2)
    assert (request.vx, request.link, request.power, request.mode) == (0.0, True, True, "walk")
    assert not receiver.receive(*pad_channels("xbox", vx=1.0), 1.3), "no second one"


def test_silence_and_refusals_cut_the_link_but_not_the_power(radio):
    receiver = Receiver(radio, 0.5)
    assert receiver.request(0.0) is None and "no message" in receiver.problem(0.0)
    assert receiver.receive(taranis(RV=1.0), [1, 1], 10.0)
    assert receiver.request(10.4).vx == 1.0 and receiver.problem(10.4) == ""
    late = receiver.request(10.6)
    assert (late.link, late.power, late.vx) == (False, True, 0.0)
    assert "silent for more than 0.5 s" in receiver.problem(10.6)
    receiver.receive(taranis(RV=float("nan")), [1, 1], 11.0)
    assert not receiver.request(11.0).link and "axis 2 = nan" in receiver.problem(11.0)
    assert receiver.receive(taranis(SA=-1.0), [1, 1], 11.1), "a moved power switch is told"
    assert receiver.request(11.1).link and not receiver.request(11.1).power


@pytest.mark.parametrize(
    ("axes", "power"),
    [
        (taranis(RV=float("nan"), SA=-1.0), False),
        (taranis(RV=float("nan"), SA=1.0), True),
        (taranis(SA=float("nan")), True),
        (taranis(SA=-1.0)[:15], True),
    ],
)
def test_the_emergency_stop_works_with_a_broken_stick(radio, axes, power):
    receiver = Receiver(radio, 0.5)
    receiver.receive(taranis(), [1, 1], 1.0)
    assert receiver.receive(axes, [1, 1], 1.1) is not power, "a moved power switch is told"
    assert receiver.request(1.1).power is power and not receiver.request(1.1).link
    assert not receiver.receive(axes, [1, 1], 1.2)
    receiver.receive(taranis(), [1, 1], 1.3)
    assert receiver.request(1.3).power and receiver.request(1.3).link


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("axes: 99", r"axes = 99 is outside 0 \.\. 64"),
        ("setpoint: {}", r"unknown key setpoint: did you mean setpoints\?"),
        ("setpoints: {vz: {axis: 0, scale: 1}}", "unknown set-point vz"),
        ("setpoints: {vx: {axis: 3, scale: 1}}", "setpoints.vx = 3: no such axis, the last is 1"),
        ("setpoints: {vx: {axis: 0}}", "setpoints.vx: scale must be given"),
        ("power: {}", "power: needs an axis or an on_button"),
        ("mode: {stand: {axis: 0}}", "unknown mode stand"),
        ("link: 1", "link = 1 is not a list of buttons"),
        ("setpoints: {vx: 3}", "setpoints.vx: expected axis, scale"),
        ("link: [-1]", r"link\[0\] = -1: no such button"),
        ("enable_button: -1", "enable_button = -1: no such button"),
        ("enable_button: true", "enable_button = True: no such button"),
        ("enable_turbo_button: 1", "enable_turbo_button = 1: no such button"),
        ("triggers: [2]", r"triggers\[0\] = 2: no such axis"),
        ("triggers: 2", "triggers = 2 is not a list of axes"),
        ("axes: [2, x]", r"axes = 'x' is outside 0 \.\. 64"),
        ("link: [5]", r"link\[0\] = 5: no such button"),
    ],
)
def test_bad_device_files_are_refused(tmp_path, change, message):
    path = tmp_path / "device.yaml"
    keys = {"axes": "2", "buttons": "1", "setpoints": "{}", "power": "{axis: 0}", "mode": "{}"}
    key, _, value = change.partition(": ")
    text = "\n".join(f"{k}: {v}" for k, v in (keys | {key: value}).items())
    path.write_text(text)
    with pytest.raises(DeviceError, match=message):
        read_device(path)


def test_the_record_switch_of_a_radio_is_a_level_and_of_a_pad_two_buttons(radio):
    receiver = Receiver(radio, 0.5)
    assert receiver.records is None
    for position, wanted in ((-1.0, False), (0.0, False), (1.0, True)):
        receiver.receive(taranis(SF=position), [1, 1], 1.0)
        assert receiver.records is wanted
    pad = Receiver(Radio(read_device(CONFIG / "xbox.yaml")), 0.5)
    for button, wanted in ((None, None), (6, True), (None, True), (8, False), (None, False)):
        pad.receive([0.0] * 8, [int(i == button) for i in range(11)], 1.0)
        assert pad.records is wanted


def test_channels_that_are_refused_move_no_record_switch(radio):
    receiver = Receiver(radio, 0.5)
    receiver.receive(taranis(SF=-1.0), [1, 1], 1.0)
    receiver.receive(taranis(SF=1.0, RV=float("nan")), [1, 1], 1.1)
    assert receiver.records is False
