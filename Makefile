# Two commands do everything: `make run` and `make test`.
SHELL := /bin/sh
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
HOST ?= 127.0.0.1
PORT ?= 8000
PYTEST_ARGS ?=
# One a core; one more is no faster, and what a test waits for comes later
WORKERS ?= $(shell cores=$$(env -u OMP_NUM_THREADS nproc); echo $$((cores < 8 ? cores : 8)))
BENCH_ARGS ?=
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export OMP_NUM_THREADS := 1
export ORT_DISABLE_TELEMETRY := 1
# Each process would compile our code and rewrite the tests anew
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup run training package test journeys soak lint lock audit bench clean compiled system-run system-test

help: ## what can be made
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: system-run $(VENV)/.run $(VENV)/.offered compiled ## virtual environment and dependencies (TRAINING=no: none of training's)

run: setup ## the site and a worker at http://127.0.0.1:8000 (HOST=, PORT=)
	@exec $(BIN)/python manage.py run --host $(HOST) --port $(PORT)

training: system-run $(VENV)/.training ## what training models needs, however large, for the next "make run"

package: $(VENV)/.run ## the racers' package, a wheel and a source archive in dist/: the engine and the command paddock
	@$(BIN)/python scripts/package.py

PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist loadgroup --no-loadscope-reorder
test: system-test $(VENV)/.test $(VENV)/.offered compiled ## every claim in minutes (PYTEST_ARGS= for more, WORKERS= at a time)
	$(PYTEST) -m "not slow and not soak" $(PYTEST_ARGS)

journeys: system-test $(VENV)/.test $(VENV)/.offered compiled ## real browsers, programs and servers from end to end: what is marked slow
	$(PYTEST) -m "slow and not soak" $(PYTEST_ARGS)

soak: system-test $(VENV)/.test $(VENV)/.offered compiled ## what both leave out: minutes each, variants, many examples
	PADDOCK_SOAK=1 $(PYTEST) -m "soak or hypothesis" $(PYTEST_ARGS)

lint: system-test $(VENV)/.test ## style, layering, types, migrations, translations
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/python manage.py makemigrations --check --dry-run
	$(BIN)/python scripts/lint_migrations.py
	$(BIN)/python manage.py check
	$(BIN)/python manage.py spectacular --validate --fail-on-warn --file /dev/null

bench: $(VENV)/.test compiled ## all benchmarks, as one JSON object (BENCH_ARGS=--quick: minutes)
	@$(BIN)/python -m benchmarks $(BENCH_ARGS)

clean: ## the virtual environment (never the data)
	rm -rf $(VENV)

system-run:
	@scripts/system-packages.sh run

system-test:
	@scripts/system-packages.sh test

# Each time: its source may have changed, or there is a compiler now. Without one the camera is slower, that is all
compiled: $(VENV)/.run
	@$(BIN)/python -m paddock.simulator.compiled || true

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Paddock needs Python 3.11 or newer; name it with make PYTHON=/path/to/python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# To the version and the sha-256 of every file; ours is built with the setuptools that is locked
LOCKED := -m pip install --quiet --require-hashes --no-deps --requirement

$(VENV)/.run: $(VENV)/bin/python pyproject.toml locks/run.txt
	$(BIN)/python $(LOCKED) locks/run.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

# Training comes with the rest where torch is small; once looked at, "make training" adds it
$(VENV)/.offered: $(VENV)/.run
	@$(BIN)/python scripts/offer_training.py
	@touch $@

# PyPI's torch carries gigabytes of CUDA: TORCH_INDEX= names the index that torch is taken from, and no other
export TORCH_INDEX ?=
$(VENV)/.training: $(VENV)/.run locks/training.txt
	$(BIN)/python scripts/offer_training.py --always
	@touch $@

$(VENV)/.test: $(VENV)/.run locks/test.txt
	$(BIN)/python $(LOCKED) locks/test.txt
	@touch $@

$(VENV)/.tools: locks/tools.txt
	$(PYTHON) -m venv $(VENV)/tools
	$(VENV)/tools/bin/python $(LOCKED) locks/tools.txt
	@touch $@

lock: $(VENV)/.tools ## locks/ and constraints.txt anew, after a change of dependencies (needs an index)
	PATH="$(CURDIR)/$(VENV)/tools/bin:$$PATH" $(VENV)/tools/bin/python scripts/lock.py

audit: $(VENV)/.tools ## known holes in what is locked (asks the index's list of them, so it needs the network)
	@for lock in run test training; do echo "$$lock:"; $(VENV)/tools/bin/pip-audit --strict --require-hashes --disable-pip --requirement locks/$$lock.txt || exit 1; done
