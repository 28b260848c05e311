"""The reader of YAML: what it knows, and what it refuses in a line, with bounded memory."""

from __future__ import annotations

import math
import os
import socket
import tracemalloc
from pathlib import Path

import pytest

from cassie_msgs.strict_yaml import MOST_BYTES, MOST_NODES, YamlError, parse_yaml, read_yaml

BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 10)}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)
"""Nine lines that stand for a thousand million words."""


def test_it_reads_what_people_write(tmp_path: Path):
    path = tmp_path / "file.yaml"
    path.write_text("a: {b: 1e3, c: [1, two, 3.5, true, null]}\n1: x\n")
    assert read_yaml(path) == {"a": {"b": 1000.0, "c": [1, "two", 3.5, True, None]}, 1: "x"}
    assert parse_yaml("", "nothing") is None


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("010", 10),
        ("+3", 3),
        ("-.5", -0.5),
        ("1.", 1.0),
        (".inf", math.inf),
        ("1:30", "1:30"),
        ("1_000", "1_000"),
        ("0x10", "0x10"),
        ("0b11", "0b11"),
    ],
)
def test_numbers_are_decimal(word: str, value: float | str):
    assert parse_yaml(word, "f") == value


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a: 1\na: 2", "f:2: key a is given twice"),
        ("a: 1\nb: {c: 1, c: 1}", "f:2: key c is given twice"),
        ("- x\n- - a: 1\n    a: 1", "f:3: key a is given twice"),
        ("1: a\n1.0: b", "f:2: key 1.0 is given twice"),
        ("a: &x [1]\nb: *x", "f:2: aliases"),
        ("a: &x [*x]", "f:1: aliases"),
        ("a: {<<: {b: 1}}", "f:1: merge keys"),
        ("? [a]\n: 1", "f:1: a key is no word"),
        ("a: [1", "f:1: expected"),
        ("a: b: c", "f:1: mapping values are not allowed here"),
        ("--- a\n--- b", "f:2: but found another document"),
        ("!!python/object:os.system x", r"f:1: tags \(!!python/object:os.system\) are not read"),
        (f"!{'x' * 10**6} y", "f:1: tags"),
        ("a: !!bool x", r"f:1: tags \(!!bool\)"),
        ("a:\n- !!int ''", r"f:2: tags \(!!int\)"),
        ("a: !!timestamp x", "f:1: tags"),
        ("!!set {a}", "f:1: tags"),
        ("a: 2001-13-44", "f: month must be in"),
        ("a: \x00", "f: unacceptable character"),
        ("1" * 5000, "f: Exceeds the limit"),
        ("[" * 5000, "f: it is nested too deeply"),
        ("[" * 5000 + "]" * 5000, "f: it is nested too deeply"),
        ("- " * 5000, "f: it is nested too deeply"),
        ("[" + "," * MOST_NODES, "f:1: "),
        ("[" + "1," * MOST_NODES + "]", f"f:1: it holds more than {MOST_NODES}"),
        (BOMB, "f:2: aliases"),
    ],
)
def test_anything_else_is_refused_in_a_line(text: str, reason: str):
    with pytest.raises(YamlError, match=f"^{reason}") as caught:
        parse_yaml(text, "f")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def socket_at(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as it:
        it.bind(str(path))


def huge_at(path: Path) -> None:
    path.touch()
    os.truncate(path, 2**40)  # sparse


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda path: None, "No such file"),
        (lambda path: path.mkdir(), "Is a directory"),
        (os.mkfifo, "it is no regular file"),
        (socket_at, "it is no regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "it is no regular file"),
        (huge_at, "it is larger than 4 MiB"),
    ],
)
def test_what_is_no_file_of_a_person_is_refused_at_once(tmp_path: Path, make, reason: str):
    path = tmp_path / "f.yaml"
    make(path)
    tracemalloc.start()
    try:
        with pytest.raises(YamlError, match=rf"cannot read .*f\.yaml: {reason}"):
            read_yaml(path)
        assert tracemalloc.get_traced_memory()[1] < 2 * MOST_BYTES
    finally:
        tracemalloc.stop()


def test_bytes_that_are_no_text_are_refused(tmp_path: Path):
    path = tmp_path / "picture.yaml"
    path.write_bytes(b"\xd0\x00")
    with pytest.raises(YamlError, match=r"picture\.yaml is not a text file"):
        read_yaml(path)
