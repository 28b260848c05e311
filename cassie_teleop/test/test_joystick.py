"""Devices through SDL: signs, choice and the message without one."""

import pytest

from cassie_teleop.joystick import JoystickError, chosen, reading


class Pad:
    """A device as SDL shows it."""

    def __init__(self, name, axes=(), hats=(), buttons=()):
        self._name, self._axes, self._hats, self._buttons = name, axes, hats, buttons
        self.get_axis, self.get_hat = axes.__getitem__, hats.__getitem__
        self.get_button = buttons.__getitem__

    def get_name(self):
        return self._name

    def get_numaxes(self):
        return len(self._axes)

    def get_numhats(self):
        return len(self._hats)

    def get_numbuttons(self):
        return len(self._buttons)


def test_left_and_up_are_positive_and_hats_come_last():
    pad = Pad("pad", axes=(-1.0, 0.5, -1.00003), hats=((-1, 1),), buttons=(True, False))
    assert reading(pad).axes == [1.0, -0.5, 1.0, 1.0, 1.0]
    assert reading(pad).buttons == [1, 0]


def test_devices_are_chosen_by_number_or_name():
    pads = [Pad("Xbox 360 Pad"), Pad("FrSky Taranis Joystick")]
    assert chosen(pads, "") is pads[0]
    assert chosen(pads, "1") is pads[1] is chosen(pads, "taranis")


@pytest.mark.parametrize("wanted", ["2", "wheel"])
def test_a_missing_device_is_refused_with_those_there_are(wanted):
    with pytest.raises(JoystickError, match=f"device = {wanted}: .* 0: Xbox"):
        chosen([Pad("Xbox 360 Pad")], wanted)


def test_no_device_at_all_is_said_plainly():
    with pytest.raises(JoystickError, match="no joystick found"):
        chosen([], "")
