"""One node of a kind in each ROS domain: the second one refuses to start.

Two simulators, estimators, controllers or supervisors in one domain would control the same robot.
So each node locks a file, one per kind and domain. The system releases the lock when the process
ends, for whatever reason. Nothing waits for discovery, and of two nodes that start at once only one
goes on. This lock does not cover nodes on other machines; `one_writer` reports them.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rclpy.node import Node

from cassie_msgs.ros.parameters import declare
from cassie_msgs.tunables import tunable

DOMAINS = range(102)
"""ROS domains whose ports no operating system uses for other things."""

RUN_DOMAINS = range(40, 100)
"""ROS domains for runs that choose a domain themselves."""


class SecondNodeError(ValueError):
    """Another node of this kind runs in the same domain."""


_TRIES = 5
_PAUSE = 0.01  # s


@dataclass(frozen=True, kw_only=True)
class ClaimConfig:
    """Parameter of every node that may run once in a domain."""

    allow_second: bool = tunable(
        False, description="Start although another node of this kind runs in the domain", live=False
    )


class Claim:
    """A node's claim to be the only one of its kind in its domain on this machine.

    `process.run` takes the claim of a node's attribute `claim` once its parameters are checked.

    Args:
        node: The node; gets the parameter `allow_second`.
        role: Kind of the node, such as "simulator".
    """

    def __init__(self, node: Node, role: str) -> None:
        self._role = role
        self._domain = node.context.get_domain_id()
        self._allow_second = declare(node, ClaimConfig()).allow_second

    def take(self) -> None:
        """Take the claim; it ends with the process.

        Raises:
            SecondNodeError: if another node has the claim; the message names a free domain.
        """
        if self._allow_second or _lock(self._domain, self._role) is not None:
            return
        raise second(self._role, self._domain, "allow_second:=true")


def second(roles: str, domain: int, permission: str) -> SecondNodeError:
    """The error for a second node; its message names a free domain.

    Args:
        roles: Kinds of the nodes that run already.
        domain: Domain in which they run.
        permission: Parameter that permits a second node.
    """
    return SecondNodeError(
        f"another {roles} runs in ROS domain {domain}: stop it, or start this one with "
        f"ROS_DOMAIN_ID={free_domain()}, which is free (-p {permission} starts it here)"
    )


def free_domain() -> int:
    """A domain in which no node with a claim runs on this machine.

    Raises:
        SecondNodeError: if there is no such domain.
    """
    for domain in DOMAINS:
        if domain not in RUN_DOMAINS and not any(map(_is_held, _files(domain))):
            return domain
    raise SecondNodeError(f"ROS domains {DOMAINS[0]} .. {DOMAINS[-1]} are all in use")


def held_domains() -> set[int]:
    """Domains in which a node with a claim runs on this machine."""
    return {domain for domain in DOMAINS if any(map(_is_held, _files(domain)))}


def held_roles(domain: int) -> set[str]:
    """Kinds of the nodes with a claim that run in a domain on this machine."""
    return {path.name.split(".")[1] for path in _files(domain) if _is_held(path)}


@contextlib.contextmanager
def run_domain() -> Iterator[int]:
    """A domain that no other run on this machine uses at the same time.

    Raises:
        SecondNodeError: if all domains are in use.
    """
    for offset in range(len(RUN_DOMAINS)):
        domain = RUN_DOMAINS[(os.getpid() + offset) % len(RUN_DOMAINS)]
        if any(map(_is_held, _files(domain))):
            continue
        lock = _lock(domain, "run")
        if lock is None:
            continue
        try:
            yield domain
        finally:
            os.close(lock)
        return
    raise SecondNodeError(f"ROS domains {RUN_DOMAINS[0]} .. {RUN_DOMAINS[-1]} are all in use")


def _file(domain: int, role: str) -> Path:
    return Path(tempfile.gettempdir()) / f"cassie_domain_{domain}.{role}.lock"


def _files(domain: int) -> list[Path]:
    return list(Path(tempfile.gettempdir()).glob(f"cassie_domain_{domain}.*.lock"))


def _lock(domain: int, role: str) -> int | None:
    """Descriptor of a lock that ends with the process; None if another process holds it."""
    try:
        descriptor = _opened(_file(domain, role))
    except OSError:
        return None
    for _ in range(_TRIES):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            time.sleep(_PAUSE)  # a process that only checks the lock holds it for a moment
        else:
            return descriptor
    os.close(descriptor)
    return None


def _is_held(path: Path) -> bool:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


def _opened(path: Path) -> int:
    """Descriptor of a lock file. Another user's file can be read but not written."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except PermissionError:
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)
