"""Bags that are damaged, and disks that take no more."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from rosbags.highlevel import AnyReader
from synthetic import TICK_NS, glide_messages
from test_bag import write_bag

from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import read_recording
from cassie_bags.bag.recover import recover
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
    assert len(left) == 1000 - 200
    assert index.lost_bytes == end - start
    assert not index.complete
    assert index.types[RobotState.TOPIC] == RobotState.TYPE
    assert [seq for _, seq, *_ in read_messages(copy, [RobotState.TOPIC])] == left


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
