#!/bin/sh
# ruff and mypy over everything that is ours.
cd "$(dirname "$0")/.." || exit 1
. ./env.sh || exit 1
status=0
ruff check . || status=1
ruff format --check --output-format concise . || { echo "lint: run make format"; status=1; }
mypy || status=1
[ $status = 0 ] && echo "make lint: clean"
exit $status
