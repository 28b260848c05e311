"""Write the parameter tables of the READMEs from the code that declares the parameters.

    python .workspace/parameter_tables.py           rewrites the tables
    python .workspace/parameter_tables.py --check   says which one is out of date, exit code 1

A table stands between `<!-- parameters: module:class -->` and `<!-- end -->`.
"""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

from cassie_msgs.tunables import Entry, entries

READMES = ("cassie_control/README.md", "cassie_sim/README.md", "cassie_teleop/README.md")
_BLOCK = re.compile(r"(<!-- parameters: (\S+):(\S+) -->\n).*?(<!-- end -->)", re.DOTALL)


def table(module: str, name: str) -> str:
    """The parameters of a configuration class as a Markdown table."""
    config = getattr(importlib.import_module(module), name)()
    lines = ["| parameter | default | range | |", "|---|---|---|---|"]
    lines += [_row(entry) for entry in entries(config)]
    return "\n".join(lines) + "\n"


def _row(entry: Entry) -> str:
    value = entry.value
    if isinstance(value, bool):
        value = str(value).lower()
    elif isinstance(value, float):
        value = f"{value:g}"
    spec = entry.spec
    fixed = "" if spec.live else "; fixed while it runs"
    default = f"{value} {spec.unit}".strip() or "(empty)"
    permitted = "true, false" if entry.kind is bool else spec.range_text
    return f"| `{entry.name}` | {default} | {permitted} | {spec.description}{fixed} |"


def filled(text: str) -> str:
    """A README with its tables made anew."""
    return _BLOCK.sub(lambda m: m[1] + table(m[2], m[3]) + m[4], text)


def main() -> int:
    """Rewrite or check the READMEs of this workspace."""
    root = Path(__file__).resolve().parents[1]
    stale = []
    for name in READMES:
        path = root / name
        text = path.read_text(encoding="utf-8")
        new = filled(text)
        if new != text:
            stale.append(name)
            if "--check" not in sys.argv:
                path.write_text(new, encoding="utf-8")
    for name in stale:
        print(f"{name}: parameter tables {'out of date' if '--check' in sys.argv else 'rewritten'}")
    return 1 if stale and "--check" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
