#!/bin/sh
# Prints the Python to build with: $PYTHON if given, else the first of CPython 3.10 to 3.13.
fits='import sys; sys.exit(not ((3, 10) <= sys.version_info[:2] <= (3, 13) and sys.implementation.name == "cpython"))'
for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11 python3.10}; do
    if "$candidate" -c "$fits" 2>/dev/null; then
        command -v "$candidate"
        exit 0
    fi
done
found=$(${PYTHON:-python3} --version 2>&1 | head -n 1)
echo "make: needs CPython 3.10 to 3.13, found: $found. On Debian: apt install python3 python3-venv python3-dev (or make PYTHON=/path/to/python3.12)" >&2
exit 1
