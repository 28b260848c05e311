"""Diagnosis of a running robot: problems and remedies, from gathered facts."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

ERROR, WARNING, NOTE = "error", "warning", "note"
LEVELS = (ERROR, WARNING, NOTE)

LANE = {
    "/cassie/sensors": "simulator",
    "/cassie/state": "state_estimator",
    "/cassie/motor_command": "gait_controller",
    "/cassie/mode": "mode_supervisor",
}
"""Node that writes each topic of the control lane; the first node stands for the robot."""

_ONE_WRITER = ("/clock", "/joy", "/cmd_vel")
_PACKAGES = {"simulator": "cassie_sim"}
_MISSED = 0.001  # share of control ticks
_SLOW = 0.95  # ratio of robot time to wall time
_BEHIND = 0.9  # ratio to the rate of the sensors
_CLOCKS = 0.5  # s of difference between the clocks of two computers
_DISK = ((100e6, ERROR), (2e9, WARNING))  # free bytes


@dataclass(frozen=True, kw_only=True)
class End:
    """One end of a topic.

    Attributes:
        writes: True for a publisher, False for a subscription.
        reliable, latched: Whether reliability is RELIABLE, and durability TRANSIENT_LOCAL.
    """

    topic: str
    node: str
    type: str
    writes: bool
    reliable: bool = True
    latched: bool = False


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Facts about a robot that other nodes can observe.

    Attributes:
        domain: ROS domain that was examined.
        other_domains: Domains of this computer in which nodes of a robot run.
        discovery: Value of ROS_AUTOMATIC_DISCOVERY_RANGE.
        held: Kinds of nodes that run on this computer in the domain, including silent ones.
        nodes: Full names of the nodes; a name that runs twice is listed twice.
        ends: Ends of the topics of the robot.
        rates: Ticks in 1/s of wall time, by topic of the control lane that was heard.
        real_time_factor: Ratio of robot time to wall time; None if no sensors were heard.
        paused: Whether the simulator reports that it is paused.
        clock_differences: Stamp of an operator's command after this computer's clock, in s, by
            operator.
        diagnostics: (level, name, message), level 0 is fine, 1 a warning, 2 and 3 errors.
        faults, mode, readiness, missed_share: Status of the mode supervisor.
        changed: (node, parameter, value, default) of parameters that differ from their default.
        files: (name, path, whether the file exists), such as the gait library.
        joysticks: (device file, whether this user may read it).
        disk: Free bytes by folder.
    """

    domain: int
    other_domains: tuple[int, ...] = ()
    discovery: str = "LOCALHOST"
    held: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()
    ends: tuple[End, ...] = ()
    rates: Mapping[str, float] = field(default_factory=dict)
    real_time_factor: float | None = None
    paused: bool = False
    clock_differences: Mapping[str, float] = field(default_factory=dict)
    diagnostics: tuple[tuple[int, str, str], ...] = ()
    faults: tuple[str, ...] = ()
    mode: str = ""
    readiness: str = ""
    missed_share: float = 0.0
    changed: tuple[tuple[str, str, Any, Any], ...] = ()
    files: tuple[tuple[str, str, bool], ...] = ()
    joysticks: tuple[tuple[str, bool], ...] = ()
    disk: Mapping[str, float] = field(default_factory=dict)

    def writers(self, topic: str) -> list[str]:
        """Nodes that publish a topic."""
        return [end.node for end in self.ends if end.writes and end.topic == topic]

    def readers(self, topic: str) -> list[str]:
        """Nodes that subscribe to a topic."""
        return [end.node for end in self.ends if not end.writes and end.topic == topic]


@dataclass(frozen=True)
class Finding:
    """One finding: severity, subject, statement, and remedy."""

    level: str
    subject: str
    problem: str
    advice: str


def findings(facts: Facts) -> list[Finding]:
    """Findings from the facts, the most severe first; of equal severity, causes before effects."""
    if not any(facts.writers(topic) for topic in LANE):
        found = [_no_robot(facts), *_machine(facts), *_network(facts)]
    else:
        found = [
            *_machine(facts),
            *_network(facts),
            *_nodes(facts),
            *_quality(facts),
            *_time(facts),
            *_reports(facts),
            *_operators(facts),
            *_parameters(facts),
        ]
    return sorted(found, key=lambda each: LEVELS.index(each.level))


def exit_code(found: Iterable[Finding]) -> int:
    """0 if there are only notes, otherwise 1."""
    return int(any(each.level != NOTE for each in found))


def report(facts: Facts, found: list[Finding]) -> str:
    """Text of the findings, and one or two lines about what was examined."""
    lines = []
    for each in found:
        lines += [f"{each.level.upper():8}{each.subject}: {each.problem}", f"{'':8}{each.advice}"]
    rates = ", ".join(f"{topic} {rate:.0f}/s" for topic, rate in sorted(facts.rates.items()))
    factor = "-" if facts.real_time_factor is None else f"{facts.real_time_factor:.2f}"
    lines += [
        f"domain {facts.domain}, {len(facts.nodes)} nodes, mode {facts.mode or '-'}, "
        f"real-time factor {factor}, missed ticks {100 * facts.missed_share:.2f} %",
        f"rates: {rates or '-'}",
    ]
    counts = [(level, sum(each.level == level for each in found)) for level in LEVELS]
    total = ", ".join(f"{n} {level}{'s' * (n > 1)}" for level, n in counts if n)
    return "\n".join([*lines, total or "nothing is wrong"])


def as_json(facts: Facts, found: list[Finding]) -> dict[str, Any]:
    """Facts and findings as plain values."""
    return {
        "findings": [dataclasses.asdict(each) for each in found],
        "facts": dataclasses.asdict(facts),
        "exit_code": exit_code(found),
    }


def _no_robot(facts: Facts) -> Finding:
    problem = f"no node of the robot runs in domain {facts.domain}"
    if facts.other_domains:
        where = ", ".join(map(str, facts.other_domains))
        advice = f"nodes run in domain {where}: export ROS_DOMAIN_ID={facts.other_domains[0]}"
        return Finding(ERROR, "nodes", problem, advice)
    return Finding(ERROR, "nodes", problem, "start it: ros2 run cassie_bags robot")


def _machine(facts: Facts) -> Iterator[Finding]:
    for folder, free in facts.disk.items():
        for least, level in _DISK:
            if free < least:
                advice = "make room: bags and logs need it"
                yield Finding(level, "disk", f"{folder} has {free / 1e6:.0f} MB left", advice)
                break
    for what, path, there in facts.files:
        if not there:
            advice = "run make build, or give the path of one that is there"
            yield Finding(ERROR, what, f"{path} is missing", advice)
    for path, readable in facts.joysticks:
        if not readable:
            advice = "sudo usermod -aG input $USER, then log in anew"
            yield Finding(WARNING, "joystick", f"this user may not read {path}", advice)


def _network(facts: Facts) -> Iterator[Finding]:
    if facts.discovery == "OFF":
        advice = "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
        yield Finding(ERROR, "discovery", "is off: nodes cannot find each other", advice)
    elif facts.discovery not in ("LOCALHOST", "OFF"):
        yield Finding(
            NOTE,
            "discovery",
            f"range {facts.discovery or 'SUBNET'}: other computers see and command this robot",
            "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST for this computer alone",
        )
    if facts.domain > 101:
        problem = f"{facts.domain} uses ports that Linux gives to other programs"
        yield Finding(WARNING, "domain", problem, "choose ROS_DOMAIN_ID from 0 .. 101")


def _nodes(facts: Facts) -> Iterator[Finding]:
    for topic, node in LANE.items():
        writers = facts.writers(topic)
        if not writers:
            package = _PACKAGES.get(node, "cassie_control")
            advice = f"start it: ros2 run {package} {node}"
            if node in facts.held:
                advice = f"it runs, but hangs or was stopped: pkill -KILL -f /{node}, then {advice}"
            yield Finding(ERROR, node, f"nobody writes {topic}", advice)
        elif len(writers) > 1:
            problem = f"{', '.join(sorted(writers))} write {topic} at once"
            yield Finding(ERROR, "second writer", problem, "end all but one of them")
    for topic in _ONE_WRITER:
        writers = sorted(facts.writers(topic))
        if len(writers) > 1:
            problem = f"{', '.join(writers)} write {topic} at once"
            yield Finding(WARNING, "second writer", problem, "end all but one of them")
    for name, count in Counter(facts.nodes).items():
        if count > 1:
            problem = f"{count} nodes are called {name}"
            advice = "end all but one, or rename it: --ros-args -r __node:=NAME"
            yield Finding(WARNING, "names", problem, advice)


def _quality(facts: Facts) -> Iterator[Finding]:
    """Findings about writers and readers of a topic that do not match."""
    for writer in (end for end in facts.ends if end.writes):
        for reader in (end for end in facts.ends if not end.writes):
            if reader.topic != writer.topic:
                continue
            reason = _mismatch(writer, reader)
            if reason:
                problem = f"{reader.node} gets nothing from {writer.node}: {reason}"
                advice = "give both the same type and a QoS that match"
                yield Finding(WARNING, f"QoS of {writer.topic}", problem, advice)


def _mismatch(writer: End, reader: End) -> str:
    if writer.type != reader.type:
        return f"{writer.type} is written, {reader.type} read"
    if reader.reliable and not writer.reliable:
        return "reliable is asked for, best effort offered"
    if reader.latched and not writer.latched:
        return "transient local is asked for, volatile offered"
    return ""


def _time(facts: Facts) -> Iterator[Finding]:
    sensors = facts.rates.get("/cassie/sensors", 0.0)
    if facts.paused:
        advice = 'go on: ros2 service call /cassie/pause std_srvs/srv/SetBool "{data: false}"'
        yield Finding(NOTE, "simulator", "is paused", advice)
    elif facts.writers("/cassie/sensors") and sensors <= 0.0:
        advice = "look at its log; in lockstep it waits for the node whose topic is silent below"
        yield Finding(ERROR, "/cassie/sensors", "is silent", advice)
    for topic in ("/cassie/state", "/cassie/motor_command"):
        rate = facts.rates.get(topic, 0.0)
        if sensors > 0.0 and facts.writers(topic) and rate < _BEHIND * sensors:
            problem = f"{rate:.0f}/s where the sensors have {sensors:.0f}/s"
            advice = f"look at the log of {', '.join(facts.writers(topic))}; free the processor"
            yield Finding(ERROR, topic, problem, advice)
    if facts.missed_share > _MISSED:
        problem = f"{100 * facts.missed_share:.1f} % of the last minute had no new command"
        advice = "end other programs, lower control_rate, or use pacing:=lockstep"
        yield Finding(ERROR, "missed ticks", problem, advice)
    factor = facts.real_time_factor
    if factor is not None and not facts.paused and 0.0 < factor < _SLOW:
        problem = f"robot time goes at {factor:.2f} of wall time"
        advice = "end other programs, or lower control_rate; max_rate may hold it back"
        yield Finding(WARNING, "real-time factor", problem, advice)
    for operator, difference in facts.clock_differences.items():
        if abs(difference) > _CLOCKS:
            problem = f"stamps of {operator} are {difference:+.1f} s off this computer's clock"
            advice = "set both clocks by NTP (chrony)"
            yield Finding(WARNING, "clocks", problem, advice)


_OPERATOR_GONE = ("operator lost", "no operator commands")
_DRIVE = "drive again: Drive on the page, or a key of keyboard_teleop"
_ADVICE = {
    "fallen": "cut the power, hang it up, switch the power on, let it down; or reset",
    "no power: ": "the operator asks for stand without a speed, and switches power off and on",
    "no answer: is gait_optimizer running?": "start it: ros2 run cassie_gaits gait_optimizer",
    **dict.fromkeys(_OPERATOR_GONE, _DRIVE),
}
"""What to do about a problem that begins with these words."""


def _advice(problem: str, otherwise: str) -> str:
    """What to do about a problem that a node reports."""
    known = (advice for words, advice in _ADVICE.items() if problem.startswith(words))
    return next(known, otherwise)


def _reports(facts: Facts) -> Iterator[Finding]:
    """Findings from the nodes' own reports."""
    no_operator = not facts.writers("/cassie/operator_command")
    for fault in facts.faults:
        if no_operator and fault.startswith(_OPERATOR_GONE):
            continue  # it never ran, or has ended: `_operators` reports that
        otherwise = "a fault ends with its cause; then arm anew: speeds to zero, power off and on"
        yield Finding(ERROR, "fault", fault, _advice(fault, otherwise))
    for level, name, message in facts.diagnostics:
        known = message in facts.faults or (no_operator and message.startswith(_OPERATOR_GONE))
        if level > 0 and not known:
            node = name.partition(":")[0]
            otherwise = f"look at the log of {node}, and ros2 topic echo /diagnostics"
            severity = WARNING if level == 1 else ERROR
            yield Finding(severity, name, message, _advice(message, otherwise))


def _operators(facts: Facts) -> Iterator[Finding]:
    if not facts.writers("/cassie/operator_command"):
        advice = "start one: ros2 run cassie_teleop web_console, or keyboard_teleop"
        yield Finding(NOTE, "operator", "nobody drives", advice)
    if facts.readers("/joy") and not facts.writers("/joy"):
        devices = ", ".join(path for path, readable in facts.joysticks if readable)
        advice = "start it: ros2 run cassie_teleop joystick"
        advice += f" (there is {devices})" if devices else "; plug one in first"
        yield Finding(WARNING, "joystick", "nobody writes /joy", advice)
    if facts.readiness:
        problem = f"the mode asked for is not entered: {facts.readiness}"
        yield Finding(NOTE, "mode", problem, "do what it waits for")


def _parameters(facts: Facts) -> Iterator[Finding]:
    for node, name, value, default in facts.changed:
        problem = f"{name} = {value}, default {default}"
        yield Finding(NOTE, node, problem, "nothing to do if that is meant")
