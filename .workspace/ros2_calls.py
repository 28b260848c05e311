"""Parameters and services of running nodes, for the small `ros2` of the wheels."""

from __future__ import annotations

import contextlib
import difflib
import os
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

import numpy as np
import rclpy
import yaml
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.parameter import get_parameter_value, parameter_value_to_python

from cassie_msgs.ros.transport import use_loopback

PATIENCE = 10.0
"""Wall time in which a node must be found, and then answer. In s."""


class CallError(Exception):
    """Nobody answers, or what was asked for makes no sense."""


def list_parameters(name: str) -> list[str]:
    """Names of a node's parameters, in alphabetical order.

    Raises:
        CallError: if no such node answers.
    """
    with _node() as node:
        answer = _call(node, _of(name, "list_parameters"), ListParameters, ListParameters.Request())
    return sorted(answer.result.names)


def get_parameter(name: str, parameter: str) -> Any:
    """The value of a parameter.

    Raises:
        CallError: if no such node answers, or it has no such parameter.
    """
    with _node() as node:
        request = GetParameters.Request(names=[parameter])
        values = _call(node, _of(name, "get_parameters"), GetParameters, request).values
    if not values or values[0].type == 0:
        close = difflib.get_close_matches(parameter, list_parameters(name), n=1)
        hint = f", did you mean {close[0]}?" if close else ""
        raise CallError(f"{name} has no parameter {parameter}{hint}")
    return parameter_value_to_python(values[0])


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
    package, _, name = type_name.partition("/srv/")
    try:
        kind = getattr(import_module(f"{package}.srv"), name)
    except (ImportError, AttributeError, ValueError, TypeError):
        raise CallError(f"no service type {type_name}: expected package/srv/Name") from None
    try:
        content = yaml.safe_load(text) or {}
    except yaml.YAMLError as error:
        raise CallError(f"the request is no YAML: {' '.join(str(error).split())}") from None
    request = kind.Request()
    _fill(request, content)
    with _node() as node:
        return _call(node, service, kind, request)


def _fill(message: Any, content: Any) -> None:
    if not isinstance(content, Mapping):
        raise CallError(f"{content!r} is no mapping of fields to values")
    fields = message.get_fields_and_field_types()
    for name, value in content.items():
        if name not in fields:
            raise CallError(f"unknown field {name}: known: {', '.join(fields)}")
        present = getattr(message, name)
        if hasattr(present, "get_fields_and_field_types"):
            _fill(present, value)
            continue
        setattr(message, name, _converted(value, present, name, fields[name]))


def _converted(value: Any, present: Any, name: str, type_name: str) -> Any:
    """A value in the type of what is there; the messages themselves do not look."""
    what = f"{name} ({type_name})"
    if isinstance(present, np.ndarray):
        try:
            array = np.array(value, dtype=present.dtype)
        except (TypeError, ValueError):
            raise CallError(f"{what}: {value!r} is no list of numbers") from None
        if array.shape != present.shape:
            raise CallError(f"{what}: {value!r} does not have {present.size} numbers")
        return array
    kind = type(present)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not kind:
        raise CallError(f"{what}: {value!r} is no {kind.__name__}")
    if kind is int:
        bounds = np.iinfo(type_name)
        if not bounds.min <= value <= bounds.max:
            raise CallError(f"{what}: {value} is outside {bounds.min} .. {bounds.max}")
    return value


@contextlib.contextmanager
def _node() -> Iterator[Node]:
    use_loopback()
    rclpy.init()
    try:
        node = rclpy.create_node(f"ros2_{os.getpid()}", start_parameter_services=False)
        yield node
        node.destroy_node()
    finally:
        rclpy.try_shutdown()


def _call(node: Node, service: str, kind: Any, request: Any) -> Any:
    try:
        client = node.create_client(kind, service)
    except NameValidationException as error:
        raise CallError(" ".join(str(error).split())) from None
    if not client.wait_for_service(PATIENCE):
        known = [name for name, _ in node.get_service_names_and_types() if name != service]
        close = difflib.get_close_matches(service, known, n=1)
        hint = f", did you mean {close[0]}?" if close else ""
        raise CallError(f"nobody serves {service} within {PATIENCE:g} s{hint}")
    future = client.call_async(request)
    rclpy.spin_until_future_complete(node, future, timeout_sec=PATIENCE)
    if not future.done():
        raise CallError(f"{service} did not answer within {PATIENCE:g} s")
    return future.result()


def _of(name: str, service: str) -> str:
    return f"/{name.strip('/')}/{service}"
