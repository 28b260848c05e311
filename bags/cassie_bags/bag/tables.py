"""Topics of a bag as tables of numbers and words, for any message type."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.records import Schema

from cassie_bags.bag.fields import FIELDS, Field, standard_field
from cassie_bags.bag.reader import BagIndex, read_messages, unknown_topic
from cassie_bags.bag.recording import TYPES, require_layouts, rows_of
from cassie_bags.bag.rows import FloatArray, IntArray, Rows
from cassie_bags.errors import BagError
from cassie_msgs.tunables import unknown_name

Array = npt.NDArray[Any]
Integers = IntArray | npt.NDArray[np.uint64]

MAX_ENTRIES = 256
"""Longest array in a table; longer ones, as of images and point clouds, are left out."""

TIMES = {
    "time": Field("s", "log_time in seconds"),
    "log_time": Field("ns", "robot time, continued over episodes"),
    "publish_time": Field("ns", "when it was sent, wall clock; robot time of a run without ROS"),
}
"""Columns at the beginning of every table."""

_RESERVED = frozenset((*TIMES, "file", "allow_pickle"))  # used by tables and numpy.savez


@dataclass(frozen=True)
class Table:
    """Messages of one topic.

    Attributes:
        topic, type: Name of the topic, and its message type.
        log_time, publish_time: Times of each message. Shape (n,), int64, in ns; uint64 if one of
            them does not fit into int64.
        fields: Arrays of numbers, or of words (`str` as objects), by dotted name of the field.
            Shape (n,) or (n, k). An entry that a message does not have is NaN or empty.
        left_out: Names of fields that are too long.
    """

    topic: str
    type: str
    log_time: Integers
    publish_time: Integers
    fields: Mapping[str, Array]
    left_out: tuple[str, ...] = ()

    def field(self, name: str) -> Field:
        """Unit and meaning of a field."""
        own = FIELDS.get(self.topic, {}) if self.type == TYPES.get(self.topic) else {}
        return TIMES.get(name) or own.get(name) or standard_field(self.type, name)

    def unit(self, column: str) -> str:
        """Unit of a column."""
        if column in TIMES or column in self.fields:
            return self.field(column).unit
        name, _, component = column.rpartition(".")
        return self.field(name).unit_of(component)

    def components(self, name: str) -> tuple[str, ...]:
        """Names of the entries of a field; empty for a scalar."""
        values = self.fields[name]
        if values.ndim == 1:
            return ()
        return self.field(name).components or tuple(str(i) for i in range(values.shape[1]))

    def columns(self) -> dict[str, Array]:
        """Every column by name, times first; an entry of an array is named `field.component`."""
        columns: dict[str, Array] = {
            "time": self.log_time / 1e9,  # the nearest number; a product may be the next one
            "log_time": self.log_time,
            "publish_time": self.publish_time,
        }
        for name, values in self.fields.items():
            if values.ndim == 1:
                columns[name] = values
            for index, component in enumerate(self.components(name)):
                columns[f"{name}.{component}"] = values[:, index]
        return columns


def read_tables(
    bag: Path | str,
    topics: Collection[str] | None = None,
    unreadable: dict[str, str] | None = None,
    index: BagIndex | None = None,
) -> dict[str, Table]:
    """Tables by topic, in the order of their names.

    Args:
        bag: MCAP file, or a folder as `ros2 bag` writes it.
        topics: Topics that are read; None for all.
        unreadable: Gets the reason for each topic whose messages cannot be read, which has no
            table then; if None, such a topic is an error.
        index: Gets types and damage of the bag.

    Raises:
        BagError: if the bag cannot be read, or lacks a topic (the message names the nearest one);
            if a topic cannot be read and `unreadable` is None.
    """
    index = BagIndex() if index is None else index
    messages: dict[str, list[tuple[int, int, bytes]]] = {}
    for topic, log_time, wall_time, data in read_messages(bag, topics, index):
        messages.setdefault(topic, []).append((log_time, wall_time, data))
    for topic in topics or ():
        if topic not in index.types:
            raise BagError(f"{bag}: {unknown_topic(topic, index.types)}")
    if not messages:
        raise BagError(f"{bag} holds no message of {', '.join(topics or ('any topic',))}")
    tables = {}
    for topic in sorted(messages):
        try:
            tables[topic] = _table(topic, messages[topic], index)
        except BagError as error:
            if unreadable is None:
                raise BagError(f"{topic} cannot be read: {error}") from None
            unreadable[topic] = str(error)
    return tables


@dataclass(frozen=True)
class Curve:
    """Columns of one field over time.

    Attributes:
        name: Topic and field.
        unit: Unit of all columns.
        time: Robot time, continued over episodes. Shape (n,), in s.
        columns: Values by name of the component, or of the field if scalar. Shape (n,) each.
    """

    name: str
    unit: str
    time: FloatArray
    columns: Mapping[str, Array]


def read_curves(bag: Path | str, names: Sequence[str]) -> list[Curve]:
    """Curves of a bag's fields by name.

    Args:
        bag: MCAP file, or a folder as `ros2 bag` writes it.
        names: TOPIC.FIELD or TOPIC.FIELD.COMPONENT; `/cassie/` may be left out.

    Raises:
        BagError: if the bag cannot be read, lacks a field (the message names the nearest one), or
            a field holds words.
    """
    index = BagIndex()
    for _ in read_messages(bag, (), index):
        pass
    parts = [_topic_of(name, index.types) for name in names]
    tables = read_tables(bag, list(dict.fromkeys(topic for topic, _ in parts)))
    curves = []
    for topic, name in parts:
        if topic not in tables:
            raise BagError(f"{bag} holds no message of {topic}")
        curves.append(_curve(tables[topic], name))
    return curves


def _topic_of(name: str, topics: Collection[str]) -> tuple[str, str]:
    """Topic and field in a name `TOPIC.FIELD`."""
    for topic in sorted(topics, key=len, reverse=True):
        for alias in (topic, topic.strip("/"), topic.removeprefix("/cassie/")):
            if name.startswith(f"{alias}."):
                return topic, name[len(alias) + 1 :]
            if name == alias:
                raise BagError(f"{name} is a topic: name a field of it, {name}.FIELD")
    raise BagError(unknown_topic(name.partition(".")[0], topics))


def _curve(table: Table, name: str) -> Curve:
    columns = table.columns()
    if name in table.fields:
        parts = table.components(name)
        chosen = {part: columns[f"{name}.{part}"] for part in parts} or {name: columns[name]}
        unit = table.field(name).unit
    elif name in columns:
        chosen, unit = {name.rpartition(".")[2]: columns[name]}, table.unit(name)
    elif below := {key: columns[key] for key in columns if key.startswith(f"{name}.")}:
        chosen, unit = {key[len(name) + 1 :]: values for key, values in below.items()}, ""
    else:
        raise BagError(unknown_name(name, [*table.fields, *columns], f"field of {table.topic}"))
    if any(values.dtype.kind not in "biuf" for values in chosen.values()):
        raise BagError(f"{table.topic}.{name} holds words, which cannot be drawn")
    return Curve(f"{table.topic}.{name}", unit, columns["time"], chosen)


def _table(topic: str, messages: list[tuple[int, int, bytes]], index: BagIndex) -> Table:
    if topic in index.unreadable:
        raise BagError(index.unreadable[topic])
    kind = index.types[topic][0]
    raw = [data for _, _, data in messages]
    log_time = _integers([time for time, _, _ in messages])
    publish_time = _integers([time for _, time, _ in messages])
    rows = _known_rows(topic, raw, index)
    if rows is not None:
        names = rows.dtype.names or ()
        return Table(topic, kind, log_time, publish_time, {name: rows[name] for name in names})
    schema = index.definitions[topic]
    if schema.encoding not in ("ros2msg", ""):
        raise BagError(f"the definition of {kind} is written in {schema.encoding}, not in ros2msg")
    fields, left_out = _decoded(schema, raw)
    return Table(topic, kind, log_time, publish_time, fields, left_out)


def _integers(values: list[int]) -> Integers:
    """Integers as int64, or as uint64 where one needs 64 bits without a sign, as MCAP's times may.

    NumPy itself makes floating-point numbers of both kinds together.
    """
    if max(values) < 1 << 63:
        return np.array(values, np.int64)
    return np.array(values, np.uint64)


def _known_rows(topic: str, raw: list[bytes], index: BagIndex) -> Rows | None:
    """Rows of our own topics; None for other topics, definitions and encodings."""
    try:
        require_layouts([topic], index)
        return rows_of(topic, raw) if topic in TYPES else None
    except BagError:
        return None


def decode(schema: Schema, raw: Collection[bytes]) -> Iterator[Any]:
    """Messages of any type as objects, decoded by the definition in the bag.

    Raises:
        BagError: if the definition or a message cannot be read.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    try:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(schema.data.decode("utf-8", "replace"), schema.name))
        for data in raw:
            if data[:2] not in (b"\0\0", b"\0\1"):
                raise BagError(f"encoding {data[:2].hex()}, not 0000 or 0001 (plain CDR)")
            yield store.deserialize_cdr(data, schema.name)
    except Exception as error:  # rosbags raises whatever its generated code does
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"cannot decode messages of {schema.name}: {reason}") from None


def _decoded(schema: Schema, raw: list[bytes]) -> tuple[dict[str, Array], tuple[str, ...]]:
    left_out: dict[str, None] = {}
    rows = [dict(_flat(message, "", left_out)) for message in decode(schema, raw)]
    names = dict.fromkeys(name for row in rows for name in row)
    fields = {}
    for name in names:
        free = name
        while free in _RESERVED or (free != name and free in names):
            free = f"message.{free}"
        fields[free] = _column([row.get(name) for row in rows])
    return fields, tuple(left_out)


def _flat(value: Any, name: str, left_out: dict[str, None]) -> Iterator[tuple[str, Any]]:
    """Numbers and words of a message by dotted name; entries of JointState by joint name.

    Where two joints have the same name, their entries are numbered.
    """
    if hasattr(value, "__msgtype__"):
        names = (field.name for field in fields(value) if field.default is MISSING)  # no constants
        entries = {key: getattr(value, key) for key in names}
        joints = entries.pop("name") if value.__msgtype__ == "sensor_msgs/msg/JointState" else None
        for key, entry in entries.items():
            if joints and len(set(joints)) == len(joints) == len(_sized(entry)):
                entry = dict(zip(joints, entry, strict=True))
            yield from _flat(entry, f"{name}.{key}" if name else key, left_out)
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from _flat(entry, f"{name}.{key}", left_out)
    elif isinstance(value, (list, np.ndarray)):
        if len(value) > MAX_ENTRIES:
            left_out[name] = None
            return
        for index, entry in enumerate(value):
            yield from _flat(entry, f"{name}.{index}", left_out)
    else:
        yield name, value.item() if isinstance(value, np.generic) else value


def _sized(value: Any) -> Any:
    return value if isinstance(value, (list, np.ndarray)) else ()


def _column(values: list[Any]) -> Array:
    """A field's values in all messages as one array; None where a message lacks the field."""
    if any(isinstance(value, str) for value in values):
        # As objects: in an array of words, each would take the space of the longest.
        return np.array(["" if value is None else value for value in values], dtype=np.object_)
    if any(value is None for value in values):
        return np.array([np.nan if value is None else value for value in values], np.float64)
    if all(type(value) is int for value in values):
        return _integers(values)
    return np.array(values)
