"""One page about many runs: a table, then each run with its phases and pictures. Self-contained."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PICTURES = ("strip", "knee_phase_portrait", "speed_tracking", "footsteps")
"""Pictures of a run that the page shows, by name, in order."""

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; }
h1, h2 { font-weight: 600; } h2 { border-top: 1px solid #ccc; padding-top: 1.2rem; }
table { border-collapse: collapse; } td, th { padding: .25rem .8rem .25rem 0; text-align: left;
       vertical-align: top; border-bottom: 1px solid #eee; }
pre { overflow-x: auto; font-size: 12px; background: #f6f6f6; padding: .6rem; }
img { max-width: 100%; } .pair img { max-width: 49%; }
.yes { color: #00704a; } .no { color: #b03a00; }
"""


@dataclass(frozen=True)
class Entry:
    """A run on the page.

    Attributes:
        content: What `report.json_line` says of it.
        about: What it is, in a sentence.
        table: Its table as text.
    """

    content: Mapping[str, Any]
    about: str
    table: str


def page(
    title: str, entries: Sequence[Entry], versions: Mapping[str, str], sweeps: Path | None = None
) -> str:
    """The page as HTML.

    Args:
        title: Its title.
        entries: The runs.
        versions: What they were made with.
        sweeps: Folder with sweeps.png and sweeps.txt to show at the end, or None.
    """
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{html.escape(title)}</h1>",
        _summary(entries),
        *(_section(entry) for entry in entries),
        _sweeps(sweeps) if sweeps is not None else "",
        "<h2>Made with</h2><p>",
        html.escape(", ".join(f"{name} {version}" for name, version in versions.items())),
        "</p></body></html>",
    ]
    return "\n".join(parts)


def _summary(entries: Sequence[Entry]) -> str:
    rows = ["<tr><th>run</th><th>seed</th><th>as expected</th><th>of it</th></tr>"]
    for entry in entries:
        content = entry.content
        good = content["passed"]
        said = "; ".join(content["failures"]) or entry.about
        anchor = _anchor(entry)
        rows.append(
            f"<tr><td><a href='#{anchor}'>{html.escape(content['name'])}</a></td>"
            f"<td>{content['seed']}</td>"
            f"<td class='{'yes' if good else 'no'}'>{'yes' if good else 'no'}</td>"
            f"<td>{html.escape(said)}</td></tr>"
        )
    passed = sum(bool(entry.content["passed"]) for entry in entries)
    return f"<p>{passed} of {len(entries)} runs as expected.</p><table>{''.join(rows)}</table>"


def _section(entry: Entry) -> str:
    parts = [
        f"<h2 id='{_anchor(entry)}'>{html.escape(entry.content['name'])}, "
        f"seed {entry.content['seed']}</h2><p>{html.escape(entry.about)}</p>",
        f"<pre>{html.escape(entry.table)}</pre><div class='pair'>",
    ]
    # Those that it names only: beside them an earlier run may have left others.
    files = entry.content.get("files", {})
    parts += [_image(Path(files[name]), name) for name in PICTURES if name in files]
    return "".join([*parts, "</div>"])


def _anchor(entry: Entry) -> str:
    return html.escape(f"{entry.content['name']}-{entry.content['seed']}", quote=True)


def _sweeps(folder: Path) -> str:
    text = folder / "sweeps.txt"
    if not text.is_file():
        return ""
    table = html.escape(text.read_text(encoding="utf-8"))
    return f"<h2>Sweeps</h2><pre>{table}</pre>" + _image(folder / "sweeps.png", "sweeps")


def _image(path: Path, name: str) -> str:
    if not path.is_file():
        return ""
    data = base64.b64encode(path.read_bytes()).decode()
    return f"<img alt='{html.escape(name)}' src='data:image/png;base64,{data}'>"
