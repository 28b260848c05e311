"""Results of a run so far: one line of JSON per gait, so that a run that was killed can go on.

The first line names the robot. Each other line has a request and its certified gait, or the reason
why there is none. Of two lines for a request the later one counts: a gait that was solved again. An
incomplete last line is ignored.
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
    """The file beside `out` in which a run stores its results.

    Args:
        out: Path of the library that is to be written.
    """

    def __init__(self, out: Path) -> None:
        self.path = out.with_name(out.name + ".partial")

    def begin(self, found: Found) -> None:
        """Write a new file, with the results that exist already."""
        header = json.dumps({"model_hash": model_hash()})
        lines = [header, *(_line(request, result) for request, result in found.items())]
        self.path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def add(self, request: Request, result: Gait | str) -> None:
        """Append a result."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(_line(request, result) + "\n")

    def remove(self) -> None:
        """Remove the file at the end of a run."""
        self.path.unlink(missing_ok=True)

    def read(self, wanted: Iterable[Request]) -> Found:
        """Results of an earlier run for the requests in `wanted`.

        Raises:
            GaitLibraryError: if the file is for another robot or damaged before its last line, or
                a gait in it differs from the certified one.
        """
        if not self.path.exists():
            return {}
        lines = self._text().split("\n")
        documents = [_parsed(line, i, self.path) for i, line in enumerate(lines[:-1])]
        if not documents or "model_hash" not in documents[0]:
            raise GaitLibraryError(
                f"{self.path}: line 1 is damaged; begin without --resume, or delete the file"
            )
        if documents[0]["model_hash"] != model_hash():
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
    if isinstance(document, dict):  # turns -0.0 into 0.0
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
