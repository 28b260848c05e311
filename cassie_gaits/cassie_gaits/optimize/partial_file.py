"""What a run has found so far: a line of JSON a gait, so that a run that was killed can go on.

The first line says for which robot; each other line holds a request and its gait, certified, or the
reason why there is none. A last line that was cut off counts as not written.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cassie_gaits.certificate.seal import flaw, gait_sha256
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.gait_library_file import gait_document, gait_of
from cassie_gaits.json_file import JsonError, check_free, parse_json, read_bounded
from cassie_gaits.model_hash import model_hash
from cassie_gaits.optimize.request import Request, as_document

Found = dict[Request, Gait | str]
"""The gait of each request, or why there is none."""


class PartialFile:
    """The file beside `out` in which a run leaves what it found.

    Args:
        out: The library that is to be written.
    """

    def __init__(self, out: Path) -> None:
        self.path = out.with_name(out.name + ".partial")

    def begin(self, found: Found) -> None:
        """Start anew, with what is there already."""
        header = json.dumps({"model_hash": model_hash()})
        lines = [header, *(_line(request, result) for request, result in found.items())]
        self.path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def add(self, request: Request, result: Gait | str) -> None:
        """Append one."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(_line(request, result) + "\n")

    def remove(self) -> None:
        """The run came to its end."""
        self.path.unlink(missing_ok=True)

    def read(self, wanted: Iterable[Request]) -> Found:
        """What an earlier run found of what is wanted.

        Raises:
            GaitLibraryError: if the file is for another robot or damaged before its last line, or
                a gait in it differs from what was certified.
        """
        if not self.path.exists():
            return {}
        lines = self._text().split("\n")
        documents = [_parsed(line, i, self.path) for i, line in enumerate(lines[:-1])]
        if not documents or documents[0].get("model_hash") != model_hash():
            raise GaitLibraryError(f"{self.path} is for another model of the robot")
        by_request = {_key(document.get("request")): document for document in documents[1:]}
        found: Found = {}
        for request in wanted:
            document = by_request.get(_key(as_document(request)))
            if document is not None:
                found[request] = _result(document, self.path)
        return found

    def _text(self) -> str:
        try:
            return read_bounded(self.path).decode("utf-8", errors="replace")
        except OSError as error:
            raise GaitLibraryError(f"{self.path}: {error.strerror}") from None


def _line(request: Request, result: Gait | str) -> str:
    content = {"reason": result} if isinstance(result, str) else {"gait": gait_document(result)}
    document = {"request": as_document(request), **content}
    return json.dumps(document, separators=(",", ":"), allow_nan=False)


def _parsed(line: str, index: int, path: Path) -> dict[str, Any]:
    try:
        document = parse_json(line)
        if isinstance(document, dict):
            check_free(document.get("request"), "request")
            return document
    except JsonError:
        pass
    raise GaitLibraryError(f"{path}: line {index + 1} is damaged")


def _key(document: object) -> str:
    if isinstance(document, dict):  # -0.0 is 0.0
        document = {k: v + 0.0 if isinstance(v, float) else v for k, v in document.items()}
    return json.dumps(document, sort_keys=True)


def _result(document: dict[str, Any], path: Path) -> Gait | str:
    if "reason" in document:
        return str(document["reason"])
    gait = gait_of(document.get("gait"), str(path))
    why = flaw(gait, gait_sha256(gait))
    if not why and gait.solver.get("request") != document["request"]:
        why = "is the answer to another request"
    if why:
        raise GaitLibraryError(f"{path}: the gait of {gait.speeds} {why}; begin without --resume")
    return gait
