"""Finds the files of a bag: one MCAP file, or a folder as `ros2 bag` writes it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cassie_bags.errors import BagError

_METADATA = "metadata.yaml"
_SQLITE = "is an SQLite bag, which is not read: ros2 bag convert makes an MCAP bag of it"


def bag_files(bag: Path | str) -> list[Path]:
    """The MCAP files of a bag, in order of time.

    Args:
        bag: MCAP file, or a folder with metadata.yaml and MCAP files, or with MCAP files alone.

    Raises:
        BagError: if there is none; the message names what was found instead.
    """
    path = Path(bag)
    try:
        if path.is_dir():
            return _files_of_folder(path)
        if path.suffix == ".db3":
            raise BagError(f"{path} {_SQLITE}")
        if path.is_file() and path.stat().st_size == 0:
            raise BagError(f"{path} is empty")
    except OSError as error:
        raise BagError(f"cannot read bag {path}: {error.strerror}") from None
    if not path.exists():
        raise BagError(f"cannot read bag {path}: No such file or directory")
    if not path.is_file():
        raise BagError(f"cannot read bag {path}: it is no regular file")
    return [path]


def _files_of_folder(folder: Path) -> list[Path]:
    files = _named_files(folder)
    if files is None:
        files = sorted(folder.glob("*.mcap"), key=_natural)
    if not files:
        if any(folder.glob("*.db3")):
            raise BagError(f"{folder} {_SQLITE}")
        raise BagError(f"{folder} holds no MCAP file")
    for file in files:
        if not file.is_file():
            raise BagError(f"{folder}: {_METADATA} names {file.name}, which is not there")
    return files


def _named_files(folder: Path) -> list[Path] | None:
    """Files that `ros2 bag` lists in metadata.yaml; None if there is no usable metadata.yaml."""
    if not (folder / _METADATA).is_file():
        return None
    from cassie_msgs.strict_yaml import YamlError, read_yaml  # not loaded for a bag that is a file

    try:
        content = read_yaml(folder / _METADATA)
    except YamlError:  # damaged: the files suffice
        return None
    section = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    if not isinstance(section, Mapping):
        return None
    names = [Path(name).name for name in _names(section, folder)]  # never elsewhere
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise BagError(f"{folder}: {_METADATA} names {twice} twice: give the file itself")
    return [folder / name for name in names]


def _names(section: Mapping[str, Any], folder: Path) -> list[str]:
    storage, mode = section.get("storage_identifier"), section.get("compression_mode") or "none"
    if storage == "sqlite3":
        raise BagError(f"{folder} {_SQLITE}")
    if storage != "mcap":
        raise BagError(f"{folder}: storage {storage!r} is not mcap")
    if str(mode).lower() != "none":
        raise BagError(f"{folder}: compression by {mode} is not read, compression of chunks is")
    names = section.get("relative_file_paths")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise BagError(f"{folder}: relative_file_paths in {_METADATA} is no list of names")
    return names


def _natural(path: Path) -> list[tuple[int, str]]:
    """Order in which bag_10 comes after bag_9."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (0, part) for part in parts]
