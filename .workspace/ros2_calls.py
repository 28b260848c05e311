"""What the small `ros2` of the wheels asks of running nodes, in the form of the real one."""

from __future__ import annotations

import contextlib
import difflib
import math
import os
import re
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rcl_interfaces.msg import Parameter, ParameterType
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
)
from rclpy.exceptions import NameValidationException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import get_parameter_value, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from cassie_msgs.ros.transport import use_loopback, wait_for_discovery

RCLError = rclpy_implementation.RCLError

TIMEOUT = 10.0
"""Wall time in which a node must be found, and then answer. In s."""

LONGEST = 128
"""Elements of an array that are shown; an ellipsis stands for the rest."""

_KINDS = {"boolean": bool, "float": float, "double": float, "string": str, "wstring": str}
_BYTES = {"octet": "uint8", "char": "uint8"}
_PLURAL = {"float": "numbers", "double": "numbers", "string": "strings", "boolean": "booleans"}
_LIST = re.compile(r"sequence<(?P<bounded>.+?)(, (?P<most>\d+))?>|(?P<element>.+)\[(?P<size>\d+)\]")
_PRIMITIVE = re.compile(r"(bool|byte|char|float32|float64|u?int(8|16|32|64)|w?string(<=\d+)?)\b")
_DURABLE, _RELIABLE = DurabilityPolicy.TRANSIENT_LOCAL, ReliabilityPolicy.RELIABLE


_TYPE_NAMES = {
    ParameterType.PARAMETER_BOOL: "boolean",
    ParameterType.PARAMETER_INTEGER: "integer",
    ParameterType.PARAMETER_DOUBLE: "double",
    ParameterType.PARAMETER_STRING: "string",
    ParameterType.PARAMETER_BYTE_ARRAY: "byte array",
    ParameterType.PARAMETER_BOOL_ARRAY: "boolean array",
    ParameterType.PARAMETER_INTEGER_ARRAY: "integer array",
    ParameterType.PARAMETER_DOUBLE_ARRAY: "double array",
    ParameterType.PARAMETER_STRING_ARRAY: "string array",
}


class CallError(Exception):
    """Nobody answers, or what was asked for makes no sense."""


def topics() -> list[tuple[str, list[str]]]:
    """Topics and their types."""
    with _node() as node:
        _settle(node)
        return sorted(node.get_topic_names_and_types())


def services() -> list[tuple[str, list[str]]]:
    """Services and their types."""
    with _node() as node:
        _settle(node)
        return sorted(node.get_service_names_and_types())


def nodes() -> list[str]:
    """Full names of the running nodes; one that runs twice is there twice."""
    with _node() as node:
        _settle(node)
        return _node_names(node)


def topic_info(topic: str, verbose: bool) -> str:
    """Type and counts of a topic, with `verbose` its ends and their QoS, too.

    Raises:
        CallError: if there is no such topic.
    """
    with _node() as node:
        types = _types(node, topic)
        publishers = node.get_publishers_info_by_topic(topic)
        subscriptions = node.get_subscriptions_info_by_topic(topic)
    lines = [f"Type: {', '.join(types)}"] + [""] * verbose
    for word, infos in (("Publisher", publishers), ("Subscription", subscriptions)):
        lines.append(f"{word} count: {len(infos)}")
        if verbose:
            lines += ["", *(f"{info}\n" for info in infos)]
    return "\n".join(lines)


def node_info(name: str) -> str:
    """Topics and services of a node.

    Raises:
        CallError: if there is no such node.
    """
    full = f"/{name.strip('/')}"
    with _node() as node:
        _settle(node)
        known = _node_names(node)
        if full not in known:
            raise CallError(f"no node {full}{_hint(full, known)}")
        space, _, base = full.rpartition("/")
        space = space or "/"
        lines = [full]
        for title, of in (
            ("Subscribers", node.get_subscriber_names_and_types_by_node),
            ("Publishers", node.get_publisher_names_and_types_by_node),
            ("Service Servers", node.get_service_names_and_types_by_node),
            ("Service Clients", node.get_client_names_and_types_by_node),
        ):
            lines.append(f"  {title}:")
            lines += [f"    {n}: {', '.join(types)}" for n, types in sorted(of(base, space))]
    return "\n".join(lines)


def echo(topic: str, once: bool, field: str, show: Callable[[str], None]) -> None:
    """Show the messages of a topic, as YAML each, until interrupted.

    Raises:
        CallError: if there is no such topic, type or field.
    """
    seen = []

    def on_message(message: Any) -> None:
        for name in filter(None, field.split(".")):
            fields = getattr(message, "get_fields_and_field_types", dict)()
            if name not in fields:
                raise CallError(f"no field {name}: known: {', '.join(fields)}")
            message = getattr(message, name)
        show(as_yaml(message) + "---")
        seen.append(True)

    with _node() as node:
        _subscribe(node, topic, on_message)
        while not (once and seen):
            rclpy.spin_once(node)


def hz(topic: str, window: int, show: Callable[[str], None]) -> None:
    """Show every second at which rate messages of a topic come, until interrupted.

    Raises:
        CallError: if there is no such topic or type.
    """
    times: deque[float] = deque(maxlen=window + 1)
    with _node() as node:
        _subscribe(node, topic, lambda _: times.append(time.monotonic()), raw=True)
        told, last = time.monotonic(), 0.0
        while True:
            rclpy.spin_once(node, timeout_sec=0.1)
            if time.monotonic() - told < 1.0:
                continue
            told = time.monotonic()
            if len(times) > 1 and times[-1] != last:
                last = times[-1]
                show(_rate(np.diff(times)))


def publish(
    topic: str, type_name: str, text: str, rate: float, count: int, show: Callable[[str], None]
) -> None:
    """Publish a message at a rate in Hz, `count` times or, for 0, until interrupted.

    Raises:
        CallError: if the type or a field is unknown.
    """
    kind = _interface(type_name, "msg")
    message = kind()
    _fill(message, _yaml(text))
    with _node() as node:
        try:
            publisher = node.create_publisher(kind, topic, 10)
        except NameValidationException as error:
            raise CallError(" ".join(str(error).split())) from None
        if count:
            deadline = time.monotonic() + TIMEOUT
            while publisher.get_subscription_count() == 0 and time.monotonic() < deadline:
                time.sleep(0.05)
        show("publisher: beginning loop")
        sent = 0
        while not count or sent < count:
            sent += 1
            show(f"publishing #{sent}: {message}")
            publisher.publish(message)
            time.sleep(1.0 / rate)


def interface(name: str) -> str:
    """Definition of a message, service or action, what it is made of indented below.

    Raises:
        CallError: if there is none.
    """
    package, _, rest = name.partition("/")
    kind, _, base = rest.rpartition("/")
    return "\n".join(_definition(package, kind or "msg", base))


def _definition(package: str, kind: str, base: str) -> list[str]:
    try:
        path = Path(get_package_share_directory(package), kind, f"{base}.{kind}")
        text = path.read_text(encoding="utf-8")
    except (PackageNotFoundError, OSError, ValueError):
        raise CallError(f"no interface {package}/{kind}/{base}") from None
    lines = []
    for line in text.splitlines():
        lines.append(line)
        words = line.split("#")[0].split()
        if len(words) < 2 or "=" in line.split("#")[0] or _PRIMITIVE.match(words[0]):
            continue
        of, _, name = words[0].split("[")[0].rpartition("/")
        if name == "Header" and not of:
            of = "std_msgs"
        inner = _definition(of.split("/")[0] or package, "msg", name)
        lines += [f"\t{i}" for i in inner if i.strip() and not i.strip().startswith("#")]
    return lines


def as_yaml(value: Any) -> str:
    """A message or a field of one as YAML."""
    plain = _plain(value)
    return str(yaml.dump(plain, allow_unicode=True, sort_keys=False, width=math.inf)).replace(
        "\n...\n", "\n"
    )


def _plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, bytes):
        return int.from_bytes(value, "little")
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (str, int, float)):
        return value
    shown = [_plain(each) for each in value[:LONGEST]]
    return shown + ["..."] * (len(value) > LONGEST)


def _rate(periods: Any) -> str:
    return (
        f"average rate: {1.0 / np.mean(periods):.3f}\n"
        f"\tmin: {np.min(periods):.3f}s max: {np.max(periods):.3f}s"
        f" std dev: {np.std(periods):.5f}s window: {len(periods)}"
    )


def _subscribe(node: Node, topic: str, act: Callable[[Any], None], raw: bool = False) -> None:
    """Listen with the QoS that fits whoever writes."""
    (type_name, *_) = _types(node, topic)
    profiles = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
    if profiles and all(each.reliability == _RELIABLE for each in profiles):
        qos.reliability = _RELIABLE
    if profiles and all(each.durability == _DURABLE for each in profiles):
        qos.durability = _DURABLE
    node.create_subscription(_interface(type_name, "msg"), topic, act, qos, raw=raw)


def _types(node: Node, topic: str) -> list[str]:
    deadline = time.monotonic() + TIMEOUT / 2
    while time.monotonic() < deadline:
        known = dict(node.get_topic_names_and_types())
        if topic in known and node.count_publishers(topic) + node.count_subscribers(topic):
            _settle(node)
            return list(known[topic])
        time.sleep(0.05)
    raise CallError(f"no topic {topic}{_hint(topic, known)}")


def _node_names(node: Node) -> list[str]:
    found = node.get_node_names_and_namespaces()
    names = [f"{space.rstrip('/')}/{name}" for name, space in found]
    return sorted(n for n in names if n != node.get_fully_qualified_name())


def _settle(node: Node) -> None:
    """Wait until discovery finds nothing new."""

    def found() -> list[object]:
        names = _node_names(node)
        return [*names, *node.get_topic_names_and_types()] if names else []  # its own are there

    wait_for_discovery(found)


def _hint(name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, list(known), n=1)
    return f", did you mean {close[0]}?" if close else ""


def _yaml(text: str) -> Any:
    try:
        return yaml.safe_load(text) or {}
    except yaml.YAMLError as error:
        raise CallError(f"the request is no YAML: {' '.join(str(error).split())}") from None


def _interface(type_name: str, kind: str) -> Any:
    package, _, name = type_name.replace(f"/{kind}/", "/").partition("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError, ValueError, TypeError):
        word = {"msg": "message", "srv": "service"}[kind]
        raise CallError(f"no {word} type {type_name}: expected package/{kind}/Name") from None


def describe_parameters(name: str, wanted: list[str]) -> str:
    """What a node says of its parameters, of all without `wanted`.

    Raises:
        CallError: if no such node answers, or it has no such parameter.
    """
    known = list_parameters(name)
    for parameter in wanted:
        if parameter not in known:
            raise CallError(f"{name} has no parameter {parameter}{_hint(parameter, known)}")
    with _node() as node:
        request = DescribeParameters.Request(names=wanted or known)
        service = _of(name, "describe_parameters")
        found = _call(node, service, DescribeParameters, request).descriptors
    return "\n".join(_described(each) for each in found)


def _described(descriptor: Any) -> str:
    kind = _TYPE_NAMES.get(descriptor.type, "not set")
    lines = [f"Parameter name: {descriptor.name}", f"  Type: {kind}"]
    if descriptor.description:
        lines.append(f"  Description: {descriptor.description}")
    lines.append("  Constraints:")
    if descriptor.read_only:
        lines.append("    Read only: true")
    for each in (*descriptor.floating_point_range, *descriptor.integer_range):
        lines += [f"    Min value: {each.from_value}", f"    Max value: {each.to_value}"]
        lines += [f"    Step: {each.step}"] if each.step else []
    if descriptor.additional_constraints:
        lines.append(f"    Additional constraints: {descriptor.additional_constraints}")
    return "\n".join(lines[:-1] if lines[-1] == "  Constraints:" else lines)


def dump_parameters(name: str) -> str:
    """All parameters of a node as a file that `load_parameters` and `--params-file` read.

    Raises:
        CallError: if no such node answers.
    """
    known = list_parameters(name)
    with _node() as node:
        request = GetParameters.Request(names=known)
        values = _call(node, _of(name, "get_parameters"), GetParameters, request).values
    plain = {
        key: _plain(parameter_value_to_python(value))
        for key, value in zip(known, values, strict=True)
        if value.type
    }
    return as_yaml({f"/{name.strip('/')}": {"ros__parameters": plain}})


def load_parameters(name: str, path: str) -> list[tuple[str, str]]:
    """Give a node the parameters of a file.

    Returns:
        Name and reason of refusal of each, empty where it holds.

    Raises:
        CallError: if no such node answers, or the file has nothing for it.
    """
    try:
        content = yaml.safe_load(Path(path).expanduser().read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise CallError(f"{path}: {' '.join(str(error).split())}") from None
    full = f"/{name.strip('/')}"
    found: dict[str, Any] = {}
    for key in ("/**", full, full[1:]):
        section = content.get(key) if isinstance(content, Mapping) else None
        values = section.get("ros__parameters") if isinstance(section, Mapping) else None
        found |= _flat(values) if isinstance(values, Mapping) else {}
    if not found:
        raise CallError(f"{path}: no ros__parameters for {full}")
    values = {key: get_parameter_value(_text(value)) for key, value in found.items()}
    with _node() as node:
        present = GetParameters.Request(names=list(values))
        old = _call(node, _of(name, "get_parameters"), GetParameters, present).values
        same = {key for key, value in zip(values, old, strict=False) if values[key] == value}
        # What is fixed while the node runs would be refused, although nothing changes.
        changes = [Parameter(name=k, value=v) for k, v in values.items() if k not in same]
        request = SetParameters.Request(parameters=changes)
        results = _call(node, _of(name, "set_parameters"), SetParameters, request).results
    reasons = {
        change.name: "" if result.successful else result.reason or "refused"
        for change, result in zip(changes, results, strict=True)
    }
    return [(key, reasons.get(key, "")) for key in values]


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        inner = isinstance(value, Mapping)
        flat |= _flat(value, f"{prefix}{key}.") if inner else {f"{prefix}{key}": value}
    return flat


def _text(value: Any) -> str:
    """A value as YAML in one line, which keeps its type."""
    return str(yaml.dump(value, default_flow_style=True, width=math.inf)).split("\n...")[0].strip()


def list_parameters(name: str) -> list[str]:
    """Names of a node's parameters, in alphabetical order.

    Raises:
        CallError: if no such node answers.
    """
    with _node() as node:
        answer = _call(node, _of(name, "list_parameters"), ListParameters, ListParameters.Request())
    return sorted(answer.result.names)


def get_parameter(name: str, parameter: str) -> tuple[str, Any]:
    """Type and value of a parameter.

    Raises:
        CallError: if no such node answers, or it has no such parameter.
    """
    with _node() as node:
        request = GetParameters.Request(names=[parameter])
        values = _call(node, _of(name, "get_parameters"), GetParameters, request).values
    if not values or values[0].type == 0:
        hint = _hint(parameter, list_parameters(name))
        raise CallError(f"{name} has no parameter {parameter}{hint}")
    return _TYPE_NAMES[values[0].type], _plain(parameter_value_to_python(values[0]))


def set_parameter(name: str, parameter: str, value: str) -> None:
    """Give a parameter a value, written as in YAML.

    Raises:
        CallError: if no such node answers, or it refuses; the message has its reason.
    """
    with _node() as node:
        change = Parameter(name=parameter, value=get_parameter_value(value))
        request = SetParameters.Request(parameters=[change])
        (result,) = _call(node, _of(name, "set_parameters"), SetParameters, request).results
    if not result.successful:
        known = list_parameters(name)
        if parameter not in known:
            raise CallError(f"{name} has no parameter {parameter}{_hint(parameter, known)}")
        raise CallError(result.reason or f"{name} refuses {parameter} = {value}")


def call_service(service: str, type_name: str, text: str) -> Any:
    """Call a service.

    Args:
        service: Its full name.
        type_name: package/srv/Name.
        text: Fields of the request as a YAML mapping; what is left out keeps its default.

    Returns:
        The response.

    Raises:
        CallError: if the type or a field is unknown, or nobody answers.
    """
    kind = _interface(type_name, "srv")
    request = kind.Request()
    _fill(request, _yaml(text))
    with _node() as node:
        return _call(node, service, kind, request)


def _fill(message: Any, content: Any) -> None:
    """Set fields of a message; those that are messages keep what is left out."""
    if not isinstance(content, Mapping):
        raise CallError(f"{content!r} is no mapping of fields to values")
    fields = message.get_fields_and_field_types()
    for name, value in content.items():
        if name not in fields:
            raise CallError(f"unknown field {name}: known: {', '.join(fields)}")
        present = getattr(message, name)
        if hasattr(present, "get_fields_and_field_types"):
            _fill(present, value)
        else:
            setattr(message, name, _converted(value, name, fields[name]))


def _converted(value: Any, name: str, type_name: str) -> Any:
    """A value in the type of a field; the messages themselves do not look at all of it."""
    what = f"{name} ({type_name})"
    listed = _LIST.fullmatch(type_name)
    if listed:
        element = listed["bounded"] or listed["element"]
        if not isinstance(value, list):
            raise CallError(f"{what}: {value!r} is no list of {_PLURAL.get(element, element)}")
        if listed["size"] and len(value) != int(listed["size"]):
            raise CallError(f"{what}: {value!r} does not have {listed['size']} elements")
        if listed["most"] and len(value) > int(listed["most"]):
            raise CallError(f"{what}: {value!r} has more than {listed['most']} elements")
        return [_converted(each, f"{name}[{i}]", element) for i, each in enumerate(value)]
    if "/" in type_name:
        message = _interface(type_name, "msg")()
        _fill(message, value)
        return message
    kind = _KINDS.get(type_name.partition("<")[0], int)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if kind is float and isinstance(value, str):  # YAML takes 1e9 and nan for words
        with contextlib.suppress(ValueError):
            return float(value)
    if type(value) is not kind:
        raise CallError(f"{what}: {value!r} is no {kind.__name__}")
    if kind is int:
        bounds = np.iinfo(_BYTES.get(type_name, type_name))
        if not bounds.min <= value <= bounds.max:
            raise CallError(f"{what}: {value} is outside {bounds.min} .. {bounds.max}")
        if type_name == "octet":
            return bytes([value])
    return value


@contextlib.contextmanager
def _node() -> Iterator[Node]:
    use_loopback()
    rclpy.init()
    try:
        node = rclpy.create_node(f"ros2_{os.getpid()}", start_parameter_services=False)
        yield node
        node.destroy_node()
    except (ExternalShutdownException, RCLError):
        if rclpy.ok():
            raise
        raise KeyboardInterrupt from None  # which rclpy has taken for itself
    finally:
        with contextlib.suppress(RCLError):  # at Ctrl-C rclpy's own thread may be the first
            rclpy.try_shutdown()


def _call(node: Node, service: str, kind: Any, request: Any) -> Any:
    try:
        client = node.create_client(kind, service)
    except NameValidationException as error:
        raise CallError(" ".join(str(error).split())) from None
    if not client.wait_for_service(TIMEOUT):
        known = [name for name, _ in node.get_service_names_and_types() if name != service]
        raise CallError(f"nobody serves {service} within {TIMEOUT:g} s{_hint(service, known)}")
    future = client.call_async(request)
    rclpy.spin_until_future_complete(node, future, timeout_sec=TIMEOUT)
    if not future.done():
        raise CallError(f"{service} did not answer within {TIMEOUT:g} s")
    return future.result()


def _of(name: str, service: str) -> str:
    return f"/{name.strip('/')}/{service}"
