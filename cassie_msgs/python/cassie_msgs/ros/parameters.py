"""ROS parameters from tunable dataclasses: declared once, with the same check for both."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node

from cassie_msgs.tunables import (
    Entry,
    ParameterError,
    entries,
    names,
    replace_checked,
    unknown_name,
)

ConfigT = TypeVar("ConfigT")
_HUGE = 1e300  # stands for no bound, as a range must have two ends
_HUGE_INT = 2**62


def descriptor(entry: Entry) -> ParameterDescriptor:
    """Descriptor of a tunable for `ros2 param describe`: description, unit, range, default.

    The default stands after the last "default " of constraints or description, as JSON.
    """
    spec = entry.spec
    text = f"{spec.description} ({spec.range_text})" if spec.range_text else spec.description
    default = f"default {json.dumps(entry.value)}"
    # Dynamic typing accepts an integer for a float; the check of tunables checks the types.
    result = ParameterDescriptor(
        name=entry.name, description=text, read_only=not spec.live, dynamic_typing=True
    )
    bounded = spec.low is not None or spec.high is not None
    if bounded and entry.kind is float:
        low = -_HUGE if spec.low is None else float(spec.low)
        high = _HUGE if spec.high is None else float(spec.high)
        result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif bounded and entry.kind is int:
        low_int = -_HUGE_INT if spec.low is None else int(spec.low)
        high_int = _HUGE_INT if spec.high is None else int(spec.high)
        result.integer_range = [IntegerRange(from_value=low_int, to_value=high_int, step=1)]
    elif spec.choices:
        result.additional_constraints = spec.range_text
        result.description = f"{text}; {default}"
        return result
    result.additional_constraints = default
    return result


def default_of(descriptor: ParameterDescriptor) -> Any:
    """The default in a descriptor; None if there is none."""
    for text in (descriptor.additional_constraints, descriptor.description):
        _, found, value = text.rpartition("default ")
        if found:
            try:
                return json.loads(value)
            except json.JSONDecodeError:
                continue
    return None


def declare(node: Node, config: ConfigT) -> ConfigT:
    """Declare every tunable of `config` and read the user's values.

    Args:
        node: Node that gets the parameters.
        config: Instance of a tunable dataclass, with the defaults.

    Returns:
        A copy of `config` with the user's values.

    Raises:
        ParameterError: naming parameter, value and range, if a value does not fit.
    """
    given: dict[str, Any] = {}
    for entry in entries(config):
        default = list(entry.value) if entry.kind is tuple else entry.value
        try:
            parameter = node.declare_parameter(entry.name, default, descriptor(entry))
        except InvalidParameterValueException as error:
            value = node._parameter_overrides[entry.name].value
            replace_checked(config, **{entry.name: value})
            raise ParameterError(f"{entry.name} = {value}: {error}") from None
        value = parameter.value
        if entry.kind is str and not isinstance(value, str):
            raise ParameterError(
                f"{entry.name} = {value} is not a text for ROS: "
                f"it needs quotes within quotes, -p {entry.name}:=\"'{value}'\""
            )
        given[entry.name] = _plain(value)
    return replace_checked(config, **given)


def on_change(node: Node, get: Callable[[], ConfigT], put: Callable[[ConfigT], None]) -> None:
    """Follow changes of the parameters that `declare` made, while the node runs.

    An invalid change is refused with the reason; then no other change of the same call is made.

    Args:
        node: Node with the parameters.
        get: Returns the present configuration.
        put: Called with the changed configuration, on the executor's thread. If it raises
            ValueError, the change is refused.
    """
    known = set(names(type(get())))

    def follow(parameters: list[Any]) -> SetParametersResult:
        changes = {p.name: _plain(p.value) for p in parameters if p.name in known}
        if not changes:
            return SetParametersResult(successful=True)
        try:
            put(replace_checked(get(), **changes))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(follow)


def refuse_unknown(*nodes: Node) -> None:
    """Check that every parameter from the user belongs to a node of this process.

    Raises:
        ParameterError: naming the first unknown parameter, and the nearest known one.
    """
    known = [name for node in nodes for name in node._parameters]
    given = [name for node in nodes for name in node._parameter_overrides]
    for name in given:
        if name not in known and not name.startswith("qos_overrides."):
            own = [name for name in known if not name.startswith("qos_overrides.")]
            raise ParameterError(unknown_name(name, own, "parameter"))


def _plain(value: Any) -> Any:
    """A ROS array as a tuple, everything else as it is."""
    if isinstance(value, (str, bytes)) or not hasattr(value, "__len__"):
        return value
    return tuple(value)
