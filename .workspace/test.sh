#!/bin/bash
# Lint, the unit tests beside each package, then the bring-up tests; closes with one line.
cd "$(dirname "$0")/.." || exit 1
. ./env.sh || exit 1
start=$SECONDS
failed=""
run() { # run NAME COMMAND...: remember the name if it fails
    local name=$1
    shift
    echo "== $name"
    "$@" || failed="$failed $name"
}
run lint .workspace/lint.sh
for package in cassie_msgs cassie_gaits cassie_control cassie_sim cassie_teleop bags; do
    if compgen -G "$package/test/test_*.py" >/dev/null; then
        run "$package" python3 -m pytest -q "$package/test"
    fi
done
if compgen -G "test/test_*.py" >/dev/null; then
    run bring-up python3 -m pytest -q test
fi
if [ -n "$failed" ]; then
    echo "make test: FAILED in$failed ($((SECONDS - start)) s)"
    exit 1
fi
echo "make test: all passed ($((SECONDS - start)) s)"
