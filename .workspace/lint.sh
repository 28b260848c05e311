#!/bin/sh
# ruff and mypy over everything that is ours.
cd "$(dirname "$0")/.." || exit 1
. ./env.sh || exit 1
status=0
ruff check . || status=1
ruff format --check --quiet . || { echo "lint: not laid out by ruff: $(ruff format --check . 2>/dev/null | grep -c '^Would') files; run make format"; status=1; }
mypy || status=1
[ $status = 0 ] && echo "make lint: clean"
exit $status
