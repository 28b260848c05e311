"""Bags damaged at random places: refused in one line, or read without what is damaged."""

from __future__ import annotations

import os
import random
import struct
import tracemalloc
from pathlib import Path

import pytest
import zstandard
from mcap.opcode import Opcode
from rosbags.highlevel import AnyReader
from synthetic import glide_messages
from test_bag import write_messages
from test_damaged_bags import parts

from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import read_recording
from cassie_bags.bag.recover import recover
from cassie_bags.bag.summary import summarize
from cassie_bags.bag.writer import BagWriter
from cassie_bags.errors import BagError

BATCHES = 10
DAMAGES = 100  # in a batch, so that 1000 in all


def write(path: Path, *, compress: bool) -> None:
    with BagWriter(path, compress=compress) as bag:
        write_messages(bag, glide_messages(1.1), stride=5)  # soon read, in as many chunks
        bag.add_file("gaits.json", bytes(range(256)) * 8)


@pytest.fixture(scope="module", params=[True, False], ids=["zstd", "none"])
def original(request, tmp_path_factory) -> tuple[bytes, dict]:
    path = tmp_path_factory.mktemp("original") / "bag.mcap"
    write(path, compress=request.param)
    index = BagIndex()
    by_topic: dict[str, list] = {}
    for topic, *message in read_messages(path, None, index):
        by_topic.setdefault(topic, []).append(tuple(message))
    assert index.complete
    return path.read_bytes(), by_topic


def flip(content: bytearray, chance: random.Random) -> None:
    for _ in range(chance.choice([1, 1, 3])):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)


def cut(content: bytearray, chance: random.Random) -> None:
    del content[chance.randrange(len(content)) :]


def insert(content: bytearray, chance: random.Random) -> None:
    place = chance.randrange(len(content))
    content[place:place] = chance.randbytes(chance.choice([1, 1, 7, 300]))


def remove(content: bytearray, chance: random.Random) -> None:
    place = chance.randrange(len(content))
    del content[place : place + chance.choice([1, 1, 9, 5000])]


def huge(content: bytearray, chance: random.Random) -> None:
    """A length somewhere becomes enormous."""
    place = chance.randrange(8, len(content) - 8)
    content[place : place + 8] = struct.pack("<Q", 1 << chance.randrange(20, 64))


def frame(content: bytearray, chance: random.Random) -> None:
    """The head of a record, where damage does most."""
    at, places = 8, []
    while at < len(content) - 8:
        places.append(at)
        at += 9 + int.from_bytes(content[at + 1 : at + 9], "little")
    content[chance.choice(places) + chance.randrange(9)] ^= 1 << chance.randrange(8)


def head(content: bytearray, chance: random.Random) -> None:
    """The start is missing, or other bytes come before it."""
    count = chance.choice([1, 2, 8, 30, 3000])
    content[: chance.choice([0, count])] = chance.randbytes(chance.choice([0, count]))


@pytest.mark.parametrize("batch", range(BATCHES))
def test_no_damage_gives_wrong_values_or_a_traceback(original, tmp_path: Path, batch: int):
    content, messages = original
    chance = random.Random(batch)
    path, saved = tmp_path / "bag.mcap", tmp_path / "saved.mcap"
    for number in range(DAMAGES // 2):  # of each compression
        damaged = bytearray(content)
        chance.choice([flip, cut, insert, remove, huge, frame, head])(damaged, chance)
        path.write_bytes(damaged)
        index = BagIndex()
        try:
            found = list(read_messages(path, None, index))
        except BagError as error:
            assert "\n" not in str(error)
            found = []
        places = dict.fromkeys(messages, 0)
        for topic, *message in found:  # of the right ones, in the right order
            places[topic] = messages[topic].index(tuple(message), places[topic]) + 1
        if bytes(damaged) != content:
            assert not index.complete, f"damage {number} is not told"
        for look in (read_recording, summarize):
            try:
                look(path)
            except BagError as error:
                assert "\n" not in str(error)
        try:
            count = recover(path, saved).messages
        except BagError:
            assert not saved.exists()
            assert not found
        else:
            assert count == len(found)
            saved.unlink()
        assert path.read_bytes() == damaged


@pytest.mark.parametrize("compress", [True, False])
def test_an_inserted_byte_costs_the_chunk_it_is_in(tmp_path: Path, compress: bool):
    path = tmp_path / "bag.mcap"
    with BagWriter(path, compress=compress) as bag:
        write_messages(bag, glide_messages(2.0))
    whole = len(list(read_messages(path)))
    content = path.read_bytes()
    chunks = [part for part in parts(path) if part[0] == Opcode.CHUNK]
    assert len(chunks) >= 4
    for _, start, end in chunks:
        for place in (start, start + 3, (start + end) // 2, end - 1):
            path.write_bytes(content[:place] + b"\x07" + content[place:])
            left = len(list(read_messages(path)))
            assert whole * (1 - 1.2 / len(chunks)) < left <= whole
    saved = tmp_path / "saved.mcap"
    assert recover(path, saved).messages == left
    with AnyReader([saved]) as reader:
        assert reader.message_count == left


@pytest.mark.parametrize("kind", ["sqlite", "ros1", "text", "empty", "zeros", "pipe", "folder"])
def test_what_is_no_mcap_file_is_refused_in_one_line(tmp_path: Path, kind: str):
    path = tmp_path / ("bag.db3" if kind == "sqlite" else "bag.mcap")
    starts = {"sqlite": b"SQLite format 3\0", "ros1": b"#ROSBAG V2.0\n", "text": b"no bag"}
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "zeros":
        path.write_bytes(bytes(100_000))
    else:
        path.write_bytes(starts.get(kind, b""))
    for look in (read_recording, summarize, lambda p: recover(p, tmp_path / "saved")):
        with pytest.raises(BagError) as error:
            look(path)
        assert "\n" not in str(error.value)
    assert not (tmp_path / "saved").exists()


@pytest.mark.parametrize("told", [1 << 45, 500_000_000])
def test_a_chunk_that_says_it_is_enormous_takes_no_memory(tmp_path: Path, told: int):
    """Also one that is, behind padding that makes its ratio of compression small."""
    path = tmp_path / "bag.mcap"
    zeros = zstandard.ZstdCompressor().compressobj(size=500_000_000)
    bomb = b"".join([*(zeros.compress(bytes(1_000_000)) for _ in range(500)), zeros.flush()])
    bomb += struct.pack("<II", 0x184D2A50, 1_000_000) + bytes(1_000_000)  # which zstd skips
    body = struct.pack("<QQQI", 0, 0, told, 0) + struct.pack("<I", 4) + b"zstd"
    body += struct.pack("<Q", len(bomb)) + bomb
    header = b"\x01" + struct.pack("<Q", 12) + struct.pack("<I", 4) + b"ros2" + bytes(4)
    path.write_bytes(b"\x89MCAP0\r\n" + header + b"\x06" + struct.pack("<Q", len(body)) + body)
    tracemalloc.start()
    assert list(read_messages(path)) == []
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100_000_000
