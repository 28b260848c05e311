"""Records: what Python writes a compiled function reads, and the other way round."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, IntArray, Record, Records, array, part, whole


class Wheel(Record):
    turn: float
    counts: IntArray = whole(2)
    axis: FloatArray = array(3)


class Cart(Record):
    steps: int = whole()
    speed: float
    spare: Wheel = part(Wheel)
    wheels: Records[Wheel] = part(Wheel, 2)


@compiled
def roll(carts: Records[Cart]) -> None:
    cart = carts[0]
    cart.steps += 1
    cart.speed *= 2.0
    cart.spare.turn += 0.5
    for wheel in cart.wheels:
        wheel.counts[1] += 3
        wheel.axis[2] = cart.speed


def test_what_is_given_or_written_in_python_is_what_a_compiled_function_changes():
    cart = Cart(speed=1.5)
    cart.steps = 7
    cart.spare.turn = 0.25
    cart.wheels[0].counts[:] = 1, 2
    cart.wheels[1].axis[:] = 4.0
    roll(cart.records)
    assert (cart.steps, cart.speed, cart.spare.turn) == (8, 3.0, 0.75)
    assert cart.wheels[0].counts.tolist() == [1, 5]
    assert cart.wheels[1].axis.tolist() == [4.0, 4.0, 3.0]


def test_a_part_takes_over_another_record():
    cart, wheel = Cart(), Wheel(0.5, counts=(1, 2), axis=np.arange(3.0))
    cart.records["spare"] = wheel.records
    assert cart.spare.turn == 0.5 and cart.spare.axis.tolist() == [0.0, 1.0, 2.0]


def test_cleared_it_is_zero_and_its_views_stay():
    cart = Cart(speed=1.0)
    counts = cart.wheels[1].counts
    counts[:] = 5
    cart.clear()
    assert cart.speed == 0.0 and counts.tolist() == [0, 0]
    counts[0] = 1
    assert cart.wheels[1].counts[0] == 1


def test_a_field_that_it_does_not_have_is_refused():
    with pytest.raises(TypeError, match="Wheel has no field radius"):
        Wheel(radius=1.0)


def test_it_takes_what_another_object_has_or_what_is_named():
    class Setting:
        speed, steps, colour = 2.5, 3, "red"

    cart = Cart()
    cart.take(Setting())
    assert (cart.speed, cart.steps) == (2.5, 3)
    cart.clear()
    cart.take(Setting(), "steps")
    assert (cart.speed, cart.steps) == (0.0, 3)
    with pytest.raises(AttributeError, match="wheels"):
        cart.take(Setting(), "wheels")
