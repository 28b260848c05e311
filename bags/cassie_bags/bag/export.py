"""Topics of a bag as files for other programs: CSV, Parquet, NumPy's npz."""

from __future__ import annotations

import csv
import hashlib
import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cassie_bags.bag.output import new_files
from cassie_bags.bag.tables import TIMES, Table
from cassie_bags.errors import BagError

UNITS = "fields.csv"
"""Name of the file with topic, column, unit, meaning and file of every column."""

_LONGEST_NAME = 100  # characters of a topic's name in that of its file
_DIGITS = re.compile(r"_[0-9a-f]{8}$")
_LARGEST_WORDS = 1 << 28  # bytes of a field's words in an npz file, where all are equally long
_CHARACTER = np.dtype("U1").itemsize


def fitting(table: Table, form: str) -> Table:
    """A table without fields that are too long for a file format, which `left_out` names.

    Args:
        table: Messages of one topic.
        form: File format, one of `FORMATS`.
    """
    if form != "npz":
        return table
    long = [
        name
        for name, values in table.fields.items()
        if values.dtype == np.object_
        and len(values) * max(map(len, values)) * _CHARACTER > _LARGEST_WORDS
    ]
    fields = {name: values for name, values in table.fields.items() if name not in long}
    return replace(table, fields=fields, left_out=(*table.left_out, *long))


def export(tables: Mapping[str, Table], folder: Path, form: str) -> list[Path]:
    """Write each topic into a file of its own, and `UNITS`; if one fails, none stays.

    Fields that are too long for the format are left out; see `fitting`.

    Args:
        tables: Tables by topic.
        folder: Target folder; it is made if it does not exist.
        form: File format, one of `FORMATS`.

    Returns:
        The written files.

    Raises:
        BagError: if a file of that name exists, which is checked before any is written; if one
            cannot be written; if the library for `form` is not installed.
    """
    write = FORMATS[form]
    tables = {topic: fitting(table, form) for topic, table in tables.items()}
    if form == "parquet":
        _pyarrow()
    files = [folder / f"{stem}.{form}" for stem in _file_stems(tables)]
    files.append(folder / UNITS)
    for path in files:
        if path.exists():
            raise BagError(f"{path} exists: give another folder with -o, or remove it")
    with new_files(files) as (*parts, units):
        for part, table in zip(parts, tables.values(), strict=True):
            write(table, part)
        _write_units(tables, files, units)
    return files


def _file_stems(topics: Collection[str]) -> list[str]:
    """Names of the topics' files: `/cassie/state` becomes `cassie_state`.

    A name that is not free, is empty or long, or ends in eight hexadecimal digits gets eight such
    digits that are made of the topic's name.
    Large and small letters do not tell names apart: some file systems do not keep them apart.
    """
    plain = [re.sub(r"[^\w-]", "_", topic.strip("/"), flags=re.ASCII) for topic in topics]
    taken = Counter([stem.lower() for stem in plain] + [Path(UNITS).stem])
    return [
        stem
        if taken[stem.lower()] == 1
        and 0 < len(stem) <= _LONGEST_NAME
        and not _DIGITS.search(stem.lower())
        else f"{stem[:_LONGEST_NAME]}_{hashlib.sha256(topic.encode()).hexdigest()[:8]}"
        for topic, stem in zip(topics, plain, strict=True)
    ]


def _write_csv(table: Table, path: Path) -> None:
    columns = table.columns()
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


def _write_npz(table: Table, path: Path) -> None:
    times = {name: table.columns()[name] for name in TIMES}
    fields = {
        name: values.astype(np.str_) if values.dtype == np.object_ else values
        for name, values in table.fields.items()
    }
    np.savez_compressed(path, allow_pickle=False, **times, **fields)


def _write_parquet(table: Table, path: Path) -> None:
    pa, parquet = _pyarrow()
    columns = table.columns()
    fields = []
    for name, values in columns.items():
        words = values.dtype == np.object_
        array_type = pa.string() if words else pa.from_numpy_dtype(values.dtype)
        fields.append(pa.field(name, array_type, metadata={"unit": table.unit(name)}))
    arrays = [
        pa.array(values.tolist() if values.dtype == np.object_ else np.ascontiguousarray(values))
        for values in columns.values()
    ]
    about = {"topic": table.topic, "type": table.type}
    parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields, about)), path)


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise BagError(
            "Parquet needs the Python package pyarrow: pip install pyarrow==26.0.1"
        ) from None
    return pyarrow, parquet


def _write_units(tables: Mapping[str, Table], files: Sequence[Path], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(("topic", "column", "unit", "about", "file"))
        for (topic, table), file in zip(tables.items(), files, strict=False):
            for name, field in TIMES.items():
                writer.writerow((topic, name, field.unit, field.about, file.name))
            for name in table.fields:
                field = table.field(name)
                for component in table.components(name) or ("",):
                    column = f"{name}.{component}" if component else name
                    writer.writerow((topic, column, table.unit(column), field.about, file.name))


FORMATS: dict[str, Callable[[Table, Path], None]] = {
    "csv": _write_csv,
    "npz": _write_npz,
    "parquet": _write_parquet,
}
"""Writers by file ending."""
