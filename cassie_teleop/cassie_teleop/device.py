"""Description of a radio or gamepad by a YAML file: the meaning of each channel."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from cassie_msgs.request import MODES, Request
from cassie_msgs.strict_yaml import YamlError, read_yaml
from cassie_msgs.tunables import from_mapping, names, tunable, unknown_name
from cassie_teleop.requests import TRIMS

SETPOINTS = ("vx", "vy", "yaw_rate", "height", "com_x", "com_y", "roll", "pitch")
_BUTTONS = ("enable_button", "enable_turbo_button")
_KEYS = ("axes", "buttons", "setpoints", "power", "mode", "record", "link", "triggers", *_BUTTONS)
PartT = TypeVar("PartT")


class DeviceError(ValueError):
    """A device file cannot be read or contradicts itself."""


@dataclass(frozen=True, kw_only=True)
class AxisMap:
    """Set-point = offset + scale * axis; negative values of the axis may have another scale."""

    axis: int = tunable(dataclasses.MISSING, "", 0, 63, "Index in Joy.axes")
    scale: float = tunable(dataclasses.MISSING, "", -5, 5, "Set-point at axis 1, minus the offset")
    scale_negative: float = tunable(0.0, "", -5, 5, "Scale of negative values; 0: as `scale`")
    scale_turbo: float = tunable(0.0, "", -5, 5, "Scale with the turbo button held; 0: as `scale`")
    offset: float = tunable(0.0, "", -5, 5, "Set-point at axis 0")
    dead_band: float = tunable(0.05, "", 0, 0.5, "Absolute value of the axis that counts as 0")


@dataclass(frozen=True, kw_only=True)
class Switch:
    """On while an axis is at least `above` or a button is pressed; or latched by two buttons."""

    axis: int = tunable(-1, "", -1, 63, "Index in Joy.axes; -1 for none")
    above: float = tunable(0.5, "", -1, 1, "Least value of the axis that means on")
    on_button: int = tunable(-1, "", -1, 63, "Button that switches on; -1 for none")
    off_button: int = tunable(-1, "", -1, 63, "Button that switches off, with priority over on")


@dataclass(frozen=True, kw_only=True)
class Device:
    """Content of a device file; `README.md` describes its keys.

    Attributes:
        axes, buttons: Permitted numbers of axes and buttons in `/joy`, in ascending order.
        triggers: Axes that are 1 at rest and that the driver reports as 0 until they are touched.
        record: Switch that begins and ends recordings; None without one.
        enable_button, enable_turbo_button: Buttons; if any is given, one must be held to move.
    """

    axes: tuple[int, ...]
    buttons: tuple[int, ...]
    setpoints: Mapping[str, AxisMap]
    power: Switch
    mode: Mapping[str, Switch]
    record: Switch | None = None
    link_buttons: tuple[int, ...] = ()
    triggers: tuple[int, ...] = ()
    enable_button: int | None = None
    enable_turbo_button: int | None = None
    start: Request = field(default_factory=Request)


def read_device(path: Path) -> Device:
    """Read and check a device file.

    Raises:
        DeviceError: if the file cannot be read or is no strict YAML; naming file, key and the
            expected value.
    """
    try:
        content = read_yaml(path)
    except YamlError as error:
        raise DeviceError(str(error)) from None
    if not isinstance(content, Mapping):
        raise DeviceError(f"{path}: expected keys {', '.join(_KEYS)}")
    try:
        return _device(content)
    except ValueError as error:
        raise DeviceError(f"{path}: {error}") from None


def _device(content: Mapping[str, Any]) -> Device:
    _only_known(content, _KEYS, "key")
    for key in ("axes", "buttons", "setpoints", "power", "mode"):
        if key not in content:
            raise DeviceError(f"{key} must be given")
    setpoints, modes = _section(content, "setpoints"), _section(content, "mode")
    _only_known(setpoints, SETPOINTS + TRIMS, "set-point")
    _only_known(modes, MODES[1:], "mode")
    device = Device(
        axes=_counts(content, "axes"),
        buttons=_counts(content, "buttons"),
        setpoints={k: _part(AxisMap, v, f"setpoints.{k}") for k, v in setpoints.items()},
        power=_part(Switch, content["power"], "power"),
        mode={k: _part(Switch, v, f"mode.{k}") for k, v in modes.items()},
        record=_part(Switch, content["record"], "record") if "record" in content else None,
        link_buttons=_indices(content, "link", "buttons"),
        triggers=_indices(content, "triggers", "axes"),
        enable_button=content.get("enable_button"),
        enable_turbo_button=content.get("enable_turbo_button"),
    )
    _check_indices(device)
    return device


def with_buttons(device: Device, enable: int, turbo: int) -> Device:
    """The device with other buttons that are held to move; -1 keeps the button of the file.

    Raises:
        DeviceError: if the device has no such button.
    """
    changed = dataclasses.replace(
        device,
        enable_button=device.enable_button if enable < 0 else enable,
        enable_turbo_button=device.enable_turbo_button if turbo < 0 else turbo,
    )
    _check_indices(changed)
    return changed


def _check_indices(device: Device) -> None:
    switches = {"power": device.power} | {f"mode.{k}": v for k, v in device.mode.items()}
    if device.record is not None:
        switches["record"] = device.record
    axes = {f"setpoints.{k}": v.axis for k, v in device.setpoints.items()}
    axes |= {k: v.axis for k, v in switches.items()}
    buttons = {f"{k}.on_button": v.on_button for k, v in switches.items()}
    buttons |= {f"{k}.off_button": v.off_button for k, v in switches.items()}
    buttons |= {f"link[{i}]": b for i, b in enumerate(device.link_buttons)}
    axes |= {f"triggers[{i}]": axis for i, axis in enumerate(device.triggers)}
    buttons |= {k: v for k in _BUTTONS if (v := getattr(device, k)) is not None}
    counts = (("axis", axes, device.axes[0]), ("button", buttons, device.buttons[0]))
    for what, table, count in counts:
        for name, index in table.items():
            none = -1 if name.partition(".")[0] in ("power", "mode", "record") else 0  # no axis
            if type(index) is not int or not none <= index < count:
                raise DeviceError(f"{name} = {index}: no such {what}, the last is {count - 1}")
    for name, switch in switches.items():
        if switch.axis < 0 and switch.on_button < 0:
            raise DeviceError(f"{name}: needs an axis or an on_button")


def _part(cls: type[PartT], mapping: object, name: str) -> PartT:
    if not isinstance(mapping, Mapping):
        raise DeviceError(f"{name}: expected {', '.join(names(cls))}")
    try:
        return from_mapping(cls, mapping)
    except ValueError as error:
        raise DeviceError(f"{name}: {error}") from None


def _indices(content: Mapping[str, Any], key: str, what: str) -> tuple[int, ...]:
    value = content.get(key, [])
    if not isinstance(value, list):
        raise DeviceError(f"{key} = {value!r} is not a list of {what}")
    return tuple(value)


def _section(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    if not isinstance(content[key], Mapping):
        raise DeviceError(f"{key}: expected names with their settings")
    return dict(content[key])


def _counts(content: Mapping[str, Any], key: str) -> tuple[int, ...]:
    value = content[key]
    counts = value if isinstance(value, list) and value else [value]
    for count in counts:
        if type(count) is not int or not 0 <= count <= 64:
            raise DeviceError(f"{key} = {count!r} is outside 0 .. 64")
    return tuple(sorted(counts))


def _only_known(given: Mapping[str, Any], known: tuple[str, ...], what: str) -> None:
    for key in given:
        if key not in known:
            raise DeviceError(unknown_name(str(key), known, what))
