"""Writes bags: MCAP in the ROS 2 profile, with message definitions, safe if the writer is killed.

A chunk is passed to the operating system within half a second of its first message in robot time,
and a fifth of a second in wall time. So a writer that is killed loses at most the last half second,
also on a busy machine.
`cassie_bags.bag.recover` makes a file with an index from the rest.

`log_time` is robot time (continued over episodes), so that a bag replays and plots on the
robot's clock at any speed of the machine. `publish_time` is wall time, when the message was sent.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from cassie_bags.bag.definitions import definition
from cassie_bags.bag.rosbag2 import (
    QOS_DEFAULT,
    QOS_KEY,
    RECORD,
    Contents,
    Qos,
    Topic,
    record_of,
    write_metadata,
)
from cassie_bags.errors import BagError

PROFILE = "ros2"
"""MCAP profile of bags with messages of ROS 2."""

CHUNK_NS = 500_000_000
"""Every chunk spans less than this. In ns of log time."""

_OPEN_NS = 200_000_000  # of wall time in which a chunk is open
_CHUNK_BYTES = 1 << 30  # chunks are closed by time, not by size


class BagWriter:
    """One bag, open for writing. Use it in a `with` statement, or call `close`.

    All methods that write raise a BagError if the file cannot be written, as when the disk is full.

    Attributes:
        path: The file.
        contents: Contents of the file written so far.
    """

    def __init__(self, path: Path | str, *, new: bool = False, compress: bool = True) -> None:
        """Create the file; its folder is made too.

        Args:
            path: The file.
            new: Whether an existing file is refused; otherwise it is replaced.
            compress: Whether chunks are compressed (zstd).

        Raises:
            BagError: if the file cannot be created.
        """
        self._compress = compress
        self._open(Path(path), new=new)

    def _open(self, path: Path, *, new: bool) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream: BinaryIO = path.open("xb" if new else "wb")
        except OSError as error:
            if new and path.exists():
                raise BagError(f"{path} exists: give another name, or remove it") from None
            raise BagError(f"cannot write bag {path}: {error.strerror}") from None
        self._writer = Writer(
            self._stream,
            chunk_size=_CHUNK_BYTES,
            compression=CompressionType.ZSTD if self._compress else CompressionType.NONE,
            enable_data_crcs=True,
        )
        self._writer.start(profile=PROFILE)
        self.contents = Contents(path.name)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._topics: dict[int, Topic] = {}
        self._first_log: int | None = None  # earliest log time of the open chunk
        self._last_log = 0
        self._chunk_wall = 0
        self._closed = False

    def add_topic(self, topic: str, type_name: str, qos: Qos = QOS_DEFAULT) -> int:
        """Declare a topic.

        Args:
            topic: Full name of the topic.
            type_name: Message type, package/msg/Name.
            qos: QoS of the topic's writers.

        Returns:
            The channel for `write`; the same one if the topic is known already.

        Raises:
            BagError: if the definition of the type is not installed.
        """
        if topic not in self._channels:
            if type_name not in self._schemas:
                text = definition(type_name).encode()
                number = self._writer.register_schema(type_name, "ros2msg", text)
                self._repeat(Schema(data=text, encoding="ros2msg", id=number, name=type_name))
                self._schemas[type_name] = number
            schema, metadata = self._schemas[type_name], {QOS_KEY: qos.text}
            channel = self._writer.register_channel(topic, "cdr", schema, metadata)
            self._repeat(Channel(channel, topic, "cdr", metadata, schema))
            self._channels[topic] = channel
            self._topics[channel] = Topic(type_name, [qos.profile])
            self.contents.topics[topic] = self._topics[channel]
        return self._channels[topic]

    def write(
        self,
        channel: int,
        data: bytes,
        log_time: int,
        wall_time: int,
        lost: int = 0,
        sent: int | None = None,
    ) -> None:
        """Append one message, with a sequence number that counts the topic's lost messages, too.

        Args:
            channel: From `add_topic`.
            data: Serialized message.
            log_time: Robot time. In ns.
            wall_time: Time of receipt. In ns; in a run without ROS, robot time again.
            lost: Number of messages of the topic that were lost so far.
            sent: Time at which it was sent; by default that of receipt. In ns of wall time.
        """
        if self._first_log is not None:
            first, last = min(self._first_log, log_time), max(self._last_log, log_time)
            if last - first >= CHUNK_NS:
                self._close_chunk()
            else:
                self._first_log, self._last_log = first, last
        if self._first_log is None:
            self._first_log = self._last_log = log_time
            self._chunk_wall = wall_time
        topic = self._topics[channel]
        topic.count += 1
        number = (topic.count + lost) & 0xFFFFFFFF
        published = wall_time if sent is None else sent
        self._writer.add_message(channel, log_time, data, published, number)
        self.flush_if_due(wall_time)

    def flush_if_due(self, wall_time: int) -> None:
        """Close the chunk if it has been open for long; to be called when no message comes in.

        Args:
            wall_time: Present wall time. In ns.
        """
        if self._first_log is not None and wall_time - self._chunk_wall >= _OPEN_NS:
            self._close_chunk()

    def add_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """Append a metadata record of words, for example the values drawn from a seed."""
        with self._reporting_errors():
            self._writer.add_metadata(name, dict(content))
            self._stream.flush()

    def add_file(self, name: str, content: bytes) -> None:
        """Append a file, for example the gait library of a run."""
        with self._reporting_errors():
            self._writer.add_attachment(0, 0, name, "application/octet-stream", content)
            self._stream.flush()

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: topic.count for name, topic in self.contents.topics.items()}

    def close(self) -> None:
        """Write the open chunk, then the index. Calling it again does nothing."""
        if not self._closed:
            self._close_chunk()
            self._closed = True
            with self._reporting_errors():
                self._writer.add_metadata(RECORD, record_of(self.contents))
                self._writer.finish()
                self._stream.close()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repeat(self, definition: Schema | Channel) -> None:
        """Write a definition between the chunks, too: `mcap` has it in the next chunk alone.

        So a damaged chunk costs no definition, also in a file without an index.
        """
        definition.write(self._writer._Writer__record_builder)

    def _close_chunk(self) -> None:
        with self._reporting_errors():
            self._writer.flush()
        if self._first_log is not None:
            self.contents.extend(self._first_log, self._last_log)
        self._first_log = None

    @contextlib.contextmanager
    def _reporting_errors(self) -> Iterator[None]:
        if self._stream.closed:
            raise BagError(f"cannot write bag {self.path}: it is closed")
        try:
            yield
        except OSError as error:
            self._closed = True  # the open chunk can never be written
            with contextlib.suppress(OSError):
                self._stream.close()
            raise BagError(f"cannot write bag {self.path}: {error.strerror}") from None


class FolderWriter(BagWriter):
    """A bag as `ros2 bag` writes it: a folder of files NAME_0.mcap, ... and metadata.yaml.

    Each file has all metadata records, so that it can be read alone; a file that is added is in
    one of them. Calling `close` again writes metadata.yaml again.

    Args:
        folder: The folder, which must not exist.
        compress: Whether chunks are compressed (zstd).
        max_bytes: Size after which the next file begins; 0 for never.
        max_duration: Log time after which the next file begins. In ns; 0 for never.

    Raises:
        BagError: if the folder exists or cannot be made.
    """

    def __init__(
        self, folder: Path, *, compress: bool = True, max_bytes: int = 0, max_duration: int = 0
    ) -> None:
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise BagError(f"{folder} exists: give another name, or remove it") from None
        except OSError as error:
            raise BagError(f"cannot write bag {folder}: {error.strerror}") from None
        self._folder = folder
        self._max_bytes, self._max_duration = max_bytes, max_duration
        self._declared: dict[str, tuple[str, Qos]] = {}
        self._metadata: dict[str, Mapping[str, str]] = {}
        self._finished: list[Contents] = []
        self._began: int | None = None  # first log time of the open file
        super().__init__(self._path(0), new=True, compress=compress)

    def add_topic(self, topic: str, type_name: str, qos: Qos = QOS_DEFAULT) -> int:
        """See `BagWriter.add_topic`."""
        channel = super().add_topic(topic, type_name, qos)
        self._declared.setdefault(topic, (type_name, qos))
        return channel

    def write(
        self,
        channel: int,
        data: bytes,
        log_time: int,
        wall_time: int,
        lost: int = 0,
        sent: int | None = None,
    ) -> None:
        """See `BagWriter.write`."""
        if self._began is not None and (
            0 < self._max_bytes <= self._stream.tell()
            or 0 < self._max_duration <= log_time - self._began
        ):
            self.split()
        if self._began is None:
            self._began = log_time
        super().write(channel, data, log_time, wall_time, lost, sent)

    def split(self) -> None:
        """Continue in a new file; the present one stays the last one if there can be no other."""
        super().close()
        finished = self.contents
        self._open(self._path(len(self._finished) + 1), new=True)
        self._finished.append(finished)
        self._began = None
        for name, content in self._metadata.items():
            super().add_metadata(name, content)
        for topic, (type_name, qos) in self._declared.items():
            super().add_topic(topic, type_name, qos)  # in the same order: the same channel

    def add_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """See `BagWriter.add_metadata`; the record goes into this file and all later ones."""
        self._metadata[name] = content
        super().add_metadata(name, content)

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        counts: Counter[str] = Counter()
        for contents in (*self._finished, self.contents):
            counts.update({name: topic.count for name, topic in contents.topics.items()})
        return dict(counts)

    def close(self) -> None:
        """Close the last file and write metadata.yaml."""
        super().close()
        write_metadata(self._folder, [*self._finished, self.contents])

    def _path(self, number: int) -> Path:
        return self._folder / f"{self._folder.resolve().name}_{number}.mcap"
