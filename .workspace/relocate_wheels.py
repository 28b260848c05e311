"""Point the wheels' exported CMake files at this interpreter.

The ROS wheels carry, in share/*/cmake, the include folders of Python and numpy on the
machine that built them (/opt/python/cpXY-cpXY/...), and system libraries of that machine, which
the wheels bring along with the libraries that use them. Run once in the virtual environment,
with its own Python, after an install. Running it again changes nothing.
"""

from __future__ import annotations

import re
import sys
import sysconfig
from pathlib import Path

import numpy

_NUMPY = re.compile(r'/opt/[^;"\s]*/numpy/(?:_core|core)/include')
_PYTHON = re.compile(r'/opt/[^;"\s]*/include/python3\.\d+')
_BROUGHT_ALONG = re.compile(r'/usr/lib64/lib[^;"\s]*\.so;')


def relocated(text: str, python_include: str, numpy_include: str) -> str:
    """`text` of a CMake file for this interpreter and without libraries of that machine."""
    text = _BROUGHT_ALONG.sub("", text)
    text = _NUMPY.sub(lambda _: numpy_include, text)
    return _PYTHON.sub(lambda _: python_include, text)


def main() -> int:
    """Rewrite every exported CMake file of this environment; says how many changed."""
    python_include = sysconfig.get_paths()["include"]
    numpy_include = numpy.get_include()
    changed = 0
    for path in sorted(Path(sys.prefix, "share").glob("*/cmake/*.cmake")):
        text = path.read_text(encoding="utf-8")
        new = relocated(text, python_include, numpy_include)
        if new != text:
            path.write_text(new, encoding="utf-8")
            changed += 1
        if "/opt/python/" in new and "/opt/python/" not in python_include:
            print(f"relocate_wheels: {path} still names /opt/python", file=sys.stderr)
            return 1
    print(f"relocate_wheels: {changed} CMake files now name {python_include}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
