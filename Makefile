# Cassie for ROS 2. `make demo` and `make test` work from a fresh clone.
SHELL := /bin/bash
.DEFAULT_GOAL := build
.PHONY: build test demo drive bench experiments sweeps results lint format dist clean distclean help

build: ## environment and workspace; does nothing where nothing changed
	@python=$$(.workspace/pick_python.sh) && $$python .workspace/build.py

test: build ## lint, unit tests of each package, bring-up tests
	@. ./env.sh && python3 .workspace/test.py

demo: build ## stand up, walk, turn, squat: each node a process; results in build/demo
	@. ./env.sh && ros2 run cassie_bags experiment bags/experiments/demo.yaml --out build/demo

drive: build ## the robot and a browser page that drives it, until Ctrl-C; ROBOT="--scene grass" for more
	@. ./env.sh && exec ros2 run cassie_bags robot --console $(ROBOT)

bench: build ## speed of the loop, side by side; also in build/bench.json
	@. ./env.sh && python3 -m cassie_bags.ros.bench --out build/bench.json

experiments: build ## every experiment file, with bags, pictures and one page: build/experiments/report.html; checks all fingerprints
	@. ./env.sh && { python3 -m cassie_bags.cli.experiment --all --in-process --no-video --out build/experiments; status=$$?; \
	[ $$status -le 1 ] && python3 -m cassie_bags.cli.fingerprint --bags build/experiments && exit $$status; }

sweeps: build ## what Cassie can do: every figure beside its target and the paper's law; ROWS="push_in_place" for some
	@. ./env.sh && python3 -m cassie_bags.cli.sweep $(ROWS) $(SWEEP_OPTIONS) --out build/sweeps

results: build ## sweeps, put into bags/RESULTS.md with command, date, revision and machine; ROWS="push_in_place" for some
	@. ./env.sh && python3 -m cassie_bags.cli.sweep $(ROWS) $(SWEEP_OPTIONS) --out build/sweeps --results bags/RESULTS.md

lint: build ## ruff, and mypy (strict on the cores)
	@.workspace/lint.sh

format: build ## let ruff lay out the code
	@.venv/bin/ruff check --fix-only --quiet . && .venv/bin/ruff format .

dist: build ## a release in build/dist: source tarball and wheels, of the present commit
	@. ./env.sh && python3 .workspace/dist.py

clean: ## remove what was built, and all results in build; keep the environment
	rm -rf build install log

distclean: clean ## remove the environment too
	rm -rf .venv

help: ## this list
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' Makefile | expand -t 12
