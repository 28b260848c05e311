"""Write constraints.txt from pip's resolution on each supported Python.

Usage, after a change of requirements.txt, with one interpreter of each version:
    python3 .workspace/lock.py python3.10 python3.11 python3.12 python3.13
Nothing is installed: pip resolves only. A version that is the same everywhere gets one
line, others one line for each Python.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

HERE = Path(__file__).resolve().parent
REQUIREMENTS = HERE.parent / "requirements.txt"
HEAD = "# Written by .workspace/lock.py from requirements.txt; not by hand.\n"


def resolution(interpreter: str) -> tuple[str, dict[str, str]]:
    """Python version and the version of each distribution pip would install for it."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([interpreter, "-m", "venv", folder], check=True)
        python, report = Path(folder, "bin/python"), Path(folder, "report.json")
        pip = [str(python), "-m", "pip", "-q", "--disable-pip-version-check", "install"]
        dry = ["--dry-run", "--ignore-installed", "--report", str(report)]
        subprocess.run([*pip, *dry, "-r", str(REQUIREMENTS)], check=True)
        return merged(json.loads(report.read_text()))


def merged(report: dict) -> tuple[str, dict[str, str]]:
    """The same from a report of pip."""
    found = {
        item["metadata"]["name"].lower().replace("_", "-"): item["metadata"]["version"]
        for item in report["install"]
    }
    return ".".join(report["environment"]["python_full_version"].split(".")[:2]), found


def constraints(resolutions: list[tuple[str, dict[str, str]]]) -> str:
    """Text of the constraints file."""
    table: dict[str, dict[str, str]] = defaultdict(dict)
    for python, found in resolutions:
        for name, version in found.items():
            table[name][python] = version
    lines = []
    for name, versions in sorted(table.items()):
        if len(set(versions.values())) == 1:
            lines.append(f"{name}=={next(iter(versions.values()))}")
        else:
            lines += [f'{name}=={v}; python_version == "{p}"' for p, v in sorted(versions.items())]
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    text = constraints([resolution(interpreter) for interpreter in sys.argv[1:]])
    (HERE / "constraints.txt").write_text(text)
