"""JSON files read strictly, with bounded memory."""

from __future__ import annotations

import errno
import gzip
import io
import json
import math
import os
import reprlib
import stat
import zlib
from collections import Counter
from pathlib import Path

from cassie_gaits.errors import CassieError

MOST_BYTES = 32 * 2**20
"""Largest size of a file, also after decompression. The dense library has 13 MB. Empty lists need
the most memory of all content, 30 times their size."""

_DEEPEST = 8
_CONTAINERS = (dict, list)


class JsonError(CassieError):
    """A file cannot be read, or is not strict JSON. The message is the reason alone."""


def read_json(path: Path) -> object:
    """The content of a JSON file. A file whose name ends in .gz is compressed.

    Raises:
        JsonError: if the file is no regular file, larger than `MOST_BYTES`, damaged, or not UTF-8;
            if it is no JSON, gives a key twice, or holds NaN, an infinity or a number too large.
    """
    try:
        content = read_bounded(path)
        return parse_json((_expanded(content) if path.suffix == ".gz" else content).decode("utf-8"))
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        reason = f"it is damaged or half written: {error}"
    except OSError as error:
        reason = error.strerror or str(error)
    except UnicodeDecodeError:
        reason = "it is not UTF-8 text"
    except MemoryError:
        reason = "it does not fit into memory"
    except ValueError as error:  # ours, and a path with a null character
        reason = str(error)
    raise JsonError(reason)


def read_bounded(path: Path, most: int = MOST_BYTES) -> bytes:
    """Content of a regular file of at most `most` bytes.

    Raises:
        OSError: if the file cannot be read, is a folder, device, pipe or socket, or is larger.
    """
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is no regular file")
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"it is {_too_large(most)}")
    return content


def parse_json(text: str) -> object:
    """The content of a text in JSON.

    Raises:
        JsonError: as `read_json`.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        reason = f"line {error.lineno} column {error.colno}: {error.msg}"
    except RecursionError:
        reason = "it is nested too deeply"
    except ValueError as error:  # ours, and integers with too many digits
        reason = str(error)
    raise JsonError(reason)


def check_free(value: object, name: str, depth: int = _DEEPEST) -> None:
    """Check that an object or list of free form can be hashed, sent and shown.

    Args:
        value: Value as `read_json` gives it; values other than objects and lists always pass.
        name: Name of the value, for messages.
        depth: Largest number of levels of lists and objects.

    Raises:
        JsonError: if the value is nested deeper, or a number is too large for a float.
    """
    if not isinstance(value, _CONTAINERS):
        return
    if depth == 0:
        raise JsonError(f"{name} is nested more than {_DEEPEST} levels deep")
    for part in value.values() if isinstance(value, dict) else value:
        if type(part) is float:
            if not math.isfinite(part):
                raise JsonError(f"{name} holds a number that is too large")
        elif isinstance(part, _CONTAINERS):
            check_free(part, name, depth - 1)


def _expanded(content: bytes) -> bytes:
    with gzip.open(io.BytesIO(content)) as file:
        expanded = file.read(MOST_BYTES + 1)
    if len(expanded) > MOST_BYTES:
        raise OSError(errno.EFBIG, f"it expands to what is {_too_large(MOST_BYTES)}")
    return expanded


def _too_large(most: int) -> str:
    return f"larger than {most / 2**20:g} MiB"


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    document = dict(pairs)
    if len(document) != len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise JsonError(f"key {reprlib.repr(twice)} is given twice")
    return document


def _refuse_constant(name: str) -> float:
    raise JsonError(f"it holds {name}, which is not a number")
