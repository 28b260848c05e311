"""Bags that are damaged, and disks that take no more."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from synthetic import TICK_NS, glide_messages
from test_bag import write_bag

from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import read_recording
from cassie_bags.bag.recover import recover
from cassie_bags.bag.summary import summarize
from cassie_bags.bag.writer import BagWriter
from cassie_bags.cli.recover import main
from cassie_bags.errors import BagError, ExperimentError
from cassie_bags.run.yaml_file import read_mapping
from cassie_msgs.layout import RobotState


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    path = tmp_path / "bag.mcap"
    write_bag(path, glide_messages(2.0))
    return path


def parts(path: Path) -> list[tuple[int, int, int]]:
    """Opcode, start and end of each record of a file."""
    content, at, found = path.read_bytes(), 8, []
    while at < len(content) - 8:
        end = at + 9 + int.from_bytes(content[at + 1 : at + 9], "little")
        found.append((content[at], at, end))
        at = end
    return found


@pytest.mark.parametrize("which", [0, 1, -1])
def test_a_damaged_chunk_costs_what_is_in_it_and_no_more(tmp_path: Path, bag: Path, which: int):
    chunks = [part for part in parts(bag) if part[0] == Opcode.CHUNK]
    _, start, end = chunks[which]
    content = bytearray(bag.read_bytes())
    content[end - 50] ^= 4
    bag.write_bytes(content)
    saved = recover(bag, tmp_path / "saved.mcap")
    assert not saved.complete
    assert saved.lost_bytes == end - start
    copy, index = tmp_path / "saved.mcap", BagIndex()
    left = [seq for _, seq, *_ in read_messages(bag, [RobotState.TOPIC], index)]
    assert len(left) == 1000 - 100
    assert index.lost_bytes == end - start
    assert not index.complete
    assert index.types[RobotState.TOPIC] == [RobotState.TYPE]
    assert [seq for _, seq, *_ in read_messages(copy, [RobotState.TOPIC])] == left


def cut_behind_the_last_chunk(path: Path, damaged: int) -> None:
    """Make a file as a killed writer leaves it, with damage in one of its chunks."""
    content = bytearray(path.read_bytes())
    chunks = [part for part in parts(path) if part[0] == Opcode.CHUNK]
    content[chunks[damaged][2] - 50] ^= 4
    path.write_bytes(content[: chunks[-1][2]])


def test_without_its_first_chunk_an_open_bag_keeps_its_definitions(tmp_path: Path, bag: Path):
    """A bag that was not closed has no copy of them at its end."""
    cut_behind_the_last_chunk(bag, 0)
    recover(bag, tmp_path / "saved.mcap")
    for path in (bag, tmp_path / "saved.mcap"):
        assert len(list(read_messages(path, [RobotState.TOPIC]))) == 1000 - 100


def test_a_bag_that_lost_all_definitions_says_so(tmp_path: Path):
    """Other writers have them in the first chunk alone."""
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channel = writer.register_channel("/empty", "cdr", schema)
        for time in range(4):
            writer.add_message(channel, time, bytes(1000), time)
            writer.flush()
        writer.finish()
    cut_behind_the_last_chunk(path, 0)
    with pytest.raises(BagError, match="3 messages without a definition of their topic"):
        recover(path, tmp_path / "saved.mcap")
    assert not (tmp_path / "saved.mcap").exists()


def test_an_index_that_became_a_message_by_one_bit_is_none(bag: Path):
    """Its channel is a known one: what it holds was given as a message of that."""
    before = list(read_messages(bag))
    content = bytearray(bag.read_bytes())
    for kind, start, _ in parts(bag):
        if kind == Opcode.MESSAGE_INDEX:
            content[start] = Opcode.MESSAGE
    bag.write_bytes(content)
    index = BagIndex()
    assert list(read_messages(bag, None, index)) == before
    assert not index.complete
    assert index.lost_bytes


@pytest.mark.parametrize("kind", [Opcode.HEADER, Opcode.METADATA])
def test_a_damaged_record_between_the_chunks_costs_only_itself(
    tmp_path: Path, bag: Path, kind: Opcode
):
    _, start, end = next(part for part in parts(bag) if part[0] == kind)
    content = bytearray(bag.read_bytes())
    content[start + 13] = 0xFF  # no first byte of a letter
    bag.write_bytes(content)
    assert len(read_recording(bag).lane[RobotState.TOPIC]) == 1000
    saved = recover(bag, tmp_path / "saved.mcap")
    assert saved.lost_bytes == end - start
    with AnyReader([tmp_path / "saved.mcap"]) as reader:
        assert reader.topics[RobotState.TOPIC].msgcount == 1000


def test_a_disk_that_is_full_leaves_no_half_recovered_bag(tmp_path: Path, bag: Path):
    target = tmp_path / "saved.mcap"
    program = f"{sys.executable} -m cassie_bags.cli.recover {bag} -o {target}"
    done = subprocess.run(
        ["bash", "-c", f"ulimit -f 20; exec {program}"],  # in KiB
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("recover: error: ") and done.stderr.count("\n") == 1
    assert not target.exists()


def test_recover_names_its_output_after_the_bag(tmp_path: Path, bag: Path, capsys):
    assert main([str(bag)]) == 0
    assert (tmp_path / "bag_recovered.mcap").is_file()
    assert main([str(bag)]) == 2
    assert "bag_recovered.mcap exists" in capsys.readouterr().err
    folder = tmp_path / "walk"
    folder.mkdir()
    bag.rename(folder / "walk_0.mcap")
    assert main([str(folder)]) == 0
    assert (tmp_path / "walk_recovered" / "metadata.yaml").is_file()


def test_aliases_that_explode_are_not_expanded(tmp_path: Path, bag: Path):
    folder = tmp_path / "walk"
    folder.mkdir()
    bag.rename(folder / "walk_0.mcap")
    levels = [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 12)]
    (folder / "metadata.yaml").write_text("a0: &a0 lol\n" + "\n".join(levels))
    assert len(read_recording(folder).truth) == 1000
    with pytest.raises(ExperimentError, match="aliases"):
        read_mapping(folder / "metadata.yaml")


def test_a_full_disk_is_one_clear_error():
    with (
        pytest.raises(BagError, match="cannot write bag /dev/full: No space left on device"),
        BagWriter(Path("/dev/full")) as bag,
    ):
        channel = bag.add_topic(RobotState.TOPIC, RobotState.TYPE)
        for tick in range(1000):
            bag.write(channel, RobotState().to_bytes(), tick * TICK_NS, tick * TICK_NS)


@pytest.mark.parametrize("place", [0, 3, 7])
def test_a_bag_whose_first_bytes_lost_a_bit_is_read_and_recovered(
    tmp_path: Path, bag: Path, place: int
):
    before = list(read_messages(bag))
    content = bytearray(bag.read_bytes())
    content[place] ^= 16
    bag.write_bytes(content)
    index = BagIndex()
    assert list(read_messages(bag, None, index)) == before
    assert not index.complete
    assert index.lost_bytes == 8
    saved = recover(bag, tmp_path / "saved.mcap")
    assert (saved.messages, saved.lost_bytes) == (len(before), 8)
    assert list(read_messages(tmp_path / "saved.mcap")) == before


def test_chunks_in_lz4_are_read_or_named(tmp_path: Path, monkeypatch):
    path = tmp_path / "lz4.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start(profile="ros2")
        channel = writer.register_channel(
            "/count", "cdr", writer.register_schema("std_msgs/msg/UInt32", "ros2msg", b"uint32 a")
        )
        for tick in range(1000):
            writer.add_message(channel, tick, struct.pack("<II", 256, tick), tick)
        writer.finish()
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "lz4.frame", None)
        for look in (summarize, lambda path: recover(path, tmp_path / "saved.mcap")):
            with pytest.raises(BagError, match=r"chunks are compressed by lz4, .* pip install lz4"):
                look(path)
        assert not (tmp_path / "saved.mcap").exists()
    pytest.importorskip("lz4.frame")
    before = list(read_messages(path))
    assert [log_time for _, log_time, *_ in before] == list(range(1000))
    content = bytearray(path.read_bytes())
    _, start, end = next(part for part in parts(path) if part[0] == Opcode.CHUNK)
    for place in range(start + 60, end, 23):
        damaged = content.copy()
        damaged[place] ^= 4
        path.write_bytes(damaged)
        assert list(read_messages(path)) in ([], before)  # other bits may mean the same


PRIVATE = b"\x80" + struct.pack("<Q", 5) + b"hello" + b"\xff" + bytes(8)
"""Two records of an application's own kinds."""


@pytest.mark.parametrize("checked", [True, False])
def test_records_of_private_kinds_are_no_damage(tmp_path: Path, bag: Path, checked: bool):
    before, original = list(read_messages(bag)), bag.read_bytes()
    data_end = next(start for kind, start, _ in parts(bag) if kind == Opcode.DATA_END)
    places = {kind: start for kind, start, _ in reversed(parts(bag)) if 0 < start <= data_end}
    for kind in (Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.DATA_END):
        content = bytearray(original)
        content[places[kind] : places[kind]] = PRIVATE
        end = data_end + len(PRIVATE)
        content[end + 9 : end + 13] = struct.pack("<I", checked and zlib.crc32(content[:end]))
        path = tmp_path / "private.mcap"
        path.write_bytes(content)
        index = BagIndex()
        assert list(read_messages(path, None, index)) == before
        assert (index.complete, index.lost_bytes) == (True, 0)
        saved = recover(path, tmp_path / "saved.mcap")
        assert saved.complete and saved.messages == len(before)
        (tmp_path / "saved.mcap").unlink()


def test_damage_before_a_chunk_and_a_private_record_costs_not_the_chunk(bag: Path):
    content = bytearray(bag.read_bytes())
    (_, first, _), (_, start, end), *_ = [part for part in parts(bag) if part[0] == Opcode.CHUNK]
    content[end:end] = PRIVATE
    content[first] = 0
    content[start - 1 : start] = b""  # the last record before the second chunk is damaged, too
    bag.write_bytes(content)
    times = [log_time for topic, log_time, *_ in read_messages(bag) if topic == RobotState.TOPIC]
    assert times == list(range(times[0], 2_000_000_000, TICK_NS))
    assert times[0] <= 500_000_000


@pytest.mark.parametrize("bit", [16, 32, 64, 128])
def test_a_record_whose_opcode_lost_a_bit_is_no_private_one(bag: Path, bit: int):
    """Also where no checksum of all data would tell."""
    content = bytearray(bag.read_bytes())
    data_end = next(start for kind, start, _ in parts(bag) if kind == Opcode.DATA_END)
    content[data_end + 9 : data_end + 13] = bytes(4)
    for kind, start, _ in parts(bag):
        damaged = content.copy()
        damaged[start] ^= bit
        bag.write_bytes(damaged)
        index = BagIndex()
        list(read_messages(bag, None, index))
        assert not index.complete, kind
        if kind == Opcode.DATA_END:
            break


def heads(content: bytes, chunk: int) -> dict[str, bytes]:
    """A bag with damage at its start, whose first chunk begins at `chunk`."""
    return {
        "byte more": b"\n" + content,
        "byte less": content[1:],
        "magic lost": content[8:],
        "header lost": content[chunk - 20 :],
        "chunk lost": content[chunk + 30 :],
        "zeros": bytes(3000) + content[3000:],
    }


@pytest.mark.parametrize("kind", heads(b"", 0))
@pytest.mark.parametrize("closed", [True, False])
def test_what_comes_after_a_damaged_start_is_recovered(
    tmp_path: Path, bag: Path, kind: str, closed: bool
):
    before, whole = list(read_messages(bag)), bag.read_bytes()
    chunks = [part for part in parts(bag) if part[0] == Opcode.CHUNK]
    content = whole if closed else whole[: chunks[-1][1] + 100]
    bag.write_bytes(heads(content, chunks[0][1])[kind])
    lost = (kind in ("chunk lost", "zeros")) + (not closed)
    if kind == "chunk lost" and not closed:  # all definitions are lost, too
        with pytest.raises(BagError, match="nothing to recover"):
            recover(bag, tmp_path / "saved.mcap")
        return
    left = list(read_messages(bag))
    assert left == (before[-len(left) :] if closed else before[: len(left)])
    assert len(left) >= len(before) * (1 - 1.2 * lost / len(chunks))
    saved = recover(bag, tmp_path / "saved.mcap")
    assert list(read_messages(tmp_path / "saved.mcap")) == left
    assert not saved.complete and saved.lost_bytes


@pytest.mark.parametrize("start", [b"", b"SQLite format 3\0", b"#ROSBAG V2.0\n", b"no bag\n" * 99])
def test_a_large_file_that_is_no_bag_is_refused_soon(tmp_path: Path, start: bytes):
    path = tmp_path / "large.mcap"
    block = start + struct.pack("<64Q", *range(64)) + bytes(range(256)) * 4
    with path.open("wb") as stream:
        for _ in range(100):
            stream.write(block * 1000)
        stream.truncate(20_000_000_000)  # the rest takes no space
    began = time.process_time()
    with pytest.raises(BagError, match="is not an MCAP file"):
        recover(path, tmp_path / "saved.mcap")
    assert time.process_time() - began < 10.0
