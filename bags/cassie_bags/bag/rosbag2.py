"""What `ros2 bag` stores besides the messages: QoS as words, and metadata.yaml of version 9.

Source:
    rosbag2 of ROS 2 Jazzy, `rosbag2_storage/yaml.hpp`, `rosbag2_storage/qos.cpp` and
    `rosbag2_storage_mcap`. The metadata of a topic's channel has the QoS of the topic's writers. A
    metadata record `rosbag2` has the content of metadata.yaml.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import McapError
from mcap.reader import make_reader

from cassie_bags.errors import BagError
from cassie_msgs.strict_yaml import YamlError, parse_yaml

METADATA_FILE = "metadata.yaml"
RECORD = "rosbag2"
"""Name of a file's metadata record that has the same content as metadata.yaml of a folder."""

QOS_KEY = "offered_qos_profiles"
"""Key of the QoS in the metadata of a channel."""

_VERSION = 9
_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_WORDS = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
    "liveliness": ("system_default", "automatic", "", "manual_by_topic", "unknown"),
}
"""Words for the numbers of older versions, in the order of rmw/types.h."""


@dataclass(frozen=True)
class Qos:
    """Quality of service of a topic's writers, in ROS's words."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10

    @property
    def profile(self) -> dict[str, Any]:
        """The full profile that `ros2 bag` stores."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(_FOREVER),
            "lifespan": dict(_FOREVER),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_FOREVER),
            "avoid_ros_namespace_conventions": False,
        }

    @cached_property
    def text(self) -> str:
        """This profile alone, as in the metadata of a channel."""
        return _profiles_text([self.profile])


QOS_LANE = Qos(depth=100)
QOS_DEFAULT = Qos()


@dataclass
class Topic:
    """A topic in a file.

    Attributes:
        type: Message type, package/msg/Name.
        profiles: QoS of the topic's writers, as in version 9.
        count: Number of messages.
    """

    type: str
    profiles: Sequence[Mapping[str, Any]]
    count: int = 0


@dataclass
class Contents:
    """Contents of one file of a bag.

    Attributes:
        name: Name of the file.
        topics: Topics by name.
        start, end: Earliest and latest log time. In ns; 0 without messages.
        empty: Whether the times are of no message.
    """

    name: str
    topics: dict[str, Topic] = field(default_factory=dict)
    start: int = 0
    end: int = 0
    empty: bool = True

    def extend(self, start: int, end: int) -> None:
        """Take in the earliest and latest log time of further messages. In ns."""
        if self.empty:
            self.start, self.end, self.empty = start, end, False
        self.start, self.end = min(self.start, start), max(self.end, end)

    @property
    def count(self) -> int:
        """Number of messages."""
        return sum(topic.count for topic in self.topics.values())


def _profiles_text(profiles: Sequence[Mapping[str, Any]]) -> str:
    """QoS profiles as the text in the metadata of a channel."""
    return str(yaml.safe_dump(list(profiles), sort_keys=False)) if profiles else ""


@lru_cache(maxsize=64)  # most topics have the same QoS, and YAML is slow
def read_profiles(text: str) -> tuple[tuple[Mapping[str, Any], ...], str]:
    """QoS profiles from a channel's metadata, with words for old versions' numbers; their text.

    Unreadable profiles are left out: a bag can be used without them.
    """
    try:
        content = parse_yaml(text, QOS_KEY)
    except YamlError:
        content = None
    entries = content if isinstance(content, list) else []
    profiles = tuple(_in_words(entry) for entry in entries if isinstance(entry, dict))
    return profiles, _profiles_text(profiles)


def _in_words(profile: Mapping[str, Any]) -> dict[str, Any]:
    complete = Qos().profile | {
        key: value for key, value in profile.items() if isinstance(key, str)
    }
    for key, words in _WORDS.items():
        value = complete[key]
        if isinstance(value, int):
            complete[key] = words[value] if 0 <= value < len(words) else "unknown"
    return complete


def information(files: Sequence[Contents]) -> dict[str, Any]:
    """Content of metadata.yaml for the files of one bag, which are given in order of time."""
    topics: dict[str, Topic] = {}
    for contents in files:
        for name, topic in contents.topics.items():
            known = topics.setdefault(name, Topic(topic.type, topic.profiles))
            known.count += topic.count
    filled = [contents for contents in files if contents.count]
    start = min((contents.start for contents in filled), default=0)
    end = max((contents.end for contents in filled), default=0)
    return {
        "version": _VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(contents.count for contents in files),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [dict(profile) for profile in topic.profiles],
                    "type_description_hash": "",
                },
                "message_count": topic.count,
            }
            for name, topic in topics.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [contents.name for contents in files],
        "files": [
            {
                "path": contents.name,
                "starting_time": {"nanoseconds_since_epoch": contents.start},
                "duration": {"nanoseconds": contents.end - contents.start},
                "message_count": contents.count,
            }
            for contents in files
        ],
        "custom_data": None,
        "ros_distro": "jazzy",
    }


def record_of(contents: Contents) -> dict[str, str]:
    """Content of the metadata record `RECORD` of a file, without the file's name: it may change."""
    content = information([contents]) | {"relative_file_paths": [], "files": []}
    return {"serialized_metadata": _text(content), "ROS_DISTRO": "jazzy"}


def write_metadata(folder: Path, files: Sequence[Contents]) -> None:
    """Write metadata.yaml, or replace it.

    Raises:
        BagError: if it cannot be written.
    """
    path = folder / METADATA_FILE
    text = _text({"rosbag2_bagfile_information": information(files)})
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BagError(f"cannot write {path}: {error.strerror}") from None


def contents_of(path: Path) -> Contents:
    """Contents of a file, from its index.

    Raises:
        BagError: if the file cannot be read or has no index, as when its writer was killed.
    """
    try:
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
    except OSError as error:
        raise BagError(f"cannot read bag {path}: {error.strerror}") from None
    except McapError as error:
        raise BagError(f"cannot read bag {path}: {error}") from None
    if summary is None or summary.statistics is None:
        raise BagError(f"{path} has no index: ros2 run cassie_bags recover makes one")
    statistics = summary.statistics
    contents = Contents(path.name, {}, statistics.message_start_time, statistics.message_end_time)
    for number, channel in summary.channels.items():
        schema = summary.schemas.get(channel.schema_id)
        contents.topics[channel.topic] = Topic(
            schema.name if schema else "",
            read_profiles(channel.metadata.get(QOS_KEY, ""))[0],
            statistics.channel_message_counts.get(number, 0),
        )
    return contents


class _NoAliases(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True


def _text(content: Mapping[str, Any]) -> str:
    return str(yaml.dump(dict(content), Dumper=_NoAliases, sort_keys=False))
