"""Files of results: they appear once they are whole, or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from cassie_bags.errors import BagError


@contextmanager
def new_files(targets: Sequence[Path]) -> Iterator[list[Path]]:
    """Temporary paths beside new files or folders, for the body of a `with` statement to write.

    After the body they get the names of `targets`. If anything fails, Ctrl-C included, no file
    stays, nor a folder that was made for them.

    Args:
        targets: The new files or folders. Folders that are to contain them are made.

    Raises:
        BagError: if one of them exists or cannot be written; the message names it.
    """
    parts = [path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}") for path in targets]
    made = _missing_folders(targets)
    renamed: list[Path] = []
    try:
        for path in targets:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield parts
        for part, path in zip(parts, targets, strict=True):
            if os.path.lexists(path):  # also a link to nothing
                raise BagError(f"{path} exists: another program has made it meanwhile")
            part.rename(path)
            renamed.append(path)
    except BaseException as error:
        for path in (*parts, *renamed):
            _remove(path)
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError):
            path = _failed(error, parts, targets)
            raise BagError(f"cannot write {path}: {error.strerror or error}") from None
        raise


def _missing_folders(targets: Sequence[Path]) -> list[Path]:
    """Folders above the targets that do not exist, the innermost first."""
    above = {folder for path in targets for folder in path.parents if not folder.exists()}
    return sorted(above, key=lambda folder: len(folder.parts), reverse=True)


def _failed(error: OSError, parts: Sequence[Path], targets: Sequence[Path]) -> Path:
    """The target that could not be written; their folder if the error does not name one."""
    for part, path in zip(parts, targets, strict=True):
        if error.filename is not None and Path(os.fsdecode(error.filename)) == part:
            return path
    return targets[0] if len(targets) == 1 else targets[0].parent


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()
