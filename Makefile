# Two commands do everything: `make run` and `make test`.
SHELL := /bin/sh
# Empty: scripts/choose-python.sh takes the best at hand
export PYTHON ?=
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

# A Python that is gone takes .venv and its stamps with it, so that comes first
.NOTPARALLEL:
.PHONY: help setup run training ldap package wheels test journeys soak lint lock audit sbom bench clean compiled system-run system-test

help: ## what can be made
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: system-run $(VENV)/.run $(VENV)/.offered compiled ## virtual environment and dependencies (TRAINING=no: none of training's)

run: setup ## the site and a worker at http://127.0.0.1:8000 (HOST=, PORT=)
	@exec $(BIN)/python manage.py run --host $(HOST) --port $(PORT)

training: system-run $(VENV)/.training ## what training models needs, for the next "make run" (TORCH_INDEX=)

ldap: system-run $(VENV)/.ldap ## what log-in by an LDAP directory needs: python-ldap, compiled here, and Debian's packages for that

package: system-run $(VENV)/.run ## the racers' packages in dist/: the engine with the command paddock, and the module names of deepracer-v0
	@$(BIN)/python scripts/package.py

wheels: ## PyBullet's wheel for this Python (PYTHON=) into dist/, beside the racers' package: pip install --find-links dist
	@$(or $(PYTHON),python3) scripts/build_pybullet.py

setup run: export STEPS := 4
test journeys soak lint bench: export STEPS := 5
PYTEST = $(BIN)/python -m pytest -n $(WORKERS) --dist loadgroup --no-loadscope-reorder
# RETRY=alone: failed tests run once more, one at a time. Status 1 of pytest: tests failed, nothing else went wrong
RETRY ?=
RETRIED := { test $$? -eq 1 -a "$(RETRY)" = alone && $(BIN)/python -m pytest --last-failed --last-failed-no-failures none; }
test: system-test $(VENV)/.offered compiled $(VENV)/.browser ## every claim in minutes (PYTEST_ARGS= for more, WORKERS= at a time)
	$(PYTEST) -m "not slow and not soak" $(PYTEST_ARGS) || $(RETRIED)

journeys: WORKERS := $(shell echo $$(($(WORKERS) + 1))) # nearly half of a journey is waiting
journeys: system-test $(VENV)/.offered compiled $(VENV)/.browser ## real browsers, programs and servers from end to end: what is marked slow
	$(PYTEST) -m "slow and not soak" $(PYTEST_ARGS) || $(RETRIED)

soak: system-test $(VENV)/.offered compiled $(VENV)/.browser ## what both leave out: minutes each, variants, many examples
	PADDOCK_SOAK=1 $(PYTEST) -m "soak or hypothesis" --timeout 7200 $(PYTEST_ARGS)

lint: system-test $(VENV)/.test ## style, layering, types, migrations, translations
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/mypy --python-version 3.14
	$(BIN)/python manage.py makemigrations --check --dry-run
	$(BIN)/python scripts/lint_migrations.py
	$(BIN)/python manage.py check
	$(BIN)/python manage.py spectacular --validate --fail-on-warn --file /dev/null

bench: system-run $(VENV)/.test compiled ## all benchmarks, as one JSON object (BENCH_ARGS=--quick: minutes)
	@$(BIN)/python -m benchmarks $(BENCH_ARGS)

CYCLONEDX = $(VENV)/tools/bin/cyclonedx-py requirements --pyproject pyproject.toml --output-reproducible
sbom: $(VENV)/.tools ## what is locked as bills of materials (CycloneDX) in dist/: of the site, and of training
	@mkdir -p dist
	@$(CYCLONEDX) --output-file dist/paddock-run.cdx.json locks/run.txt
	@{ cat locks/training.txt; grep ^torch== constraints.txt; } | $(CYCLONEDX) --output-file dist/paddock-training.cdx.json -

clean: ## the virtual environment (never the data)
	rm -rf $(VENV)

system-run:
	@scripts/system-packages.sh run
	@scripts/choose-python.sh $(VENV)

system-test:
	@scripts/system-packages.sh test
	@scripts/choose-python.sh $(VENV)

# Each time: its source may have changed, or there is a compiler now. Without one the camera is slower, that is all
compiled: $(VENV)/.run
	@$(BIN)/python -m paddock.simulator.compiled || true

$(VENV)/bin/python:
	@scripts/choose-python.sh $(VENV)

# To the version and the sha-256 of every file; ours is built with the setuptools that is locked
PIP := scripts/pip_progress.py
LOCKED := $(PIP) install --require-hashes --no-deps --requirement

# A source archive alone, built with the setuptools that is locked, too
DIRECTORY = $(BIN)/python $(LOCKED) locks/ldap.txt --no-build-isolation

$(VENV)/.run: $(VENV)/bin/python pyproject.toml locks/run.txt
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(BIN)/python -m ensurepip >/dev/null # the first make was cut off
	@$(BIN)/python scripts/build_pybullet.py --install # for pip it is there already, where no wheel has a locked hash
	@STEP=3 $(BIN)/python $(LOCKED) locks/run.txt
	@STEP=3 $(BIN)/python $(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

# Training comes with the rest; where it was left out, "make training" adds it. A download that broke off goes on next time
$(VENV)/.offered: $(VENV)/.run
	@if STEP=4 $(BIN)/python scripts/offer_training.py; then touch $@; fi

$(VENV)/.training: $(VENV)/.run locks/training.txt locks/torch.sha256
	$(BIN)/python scripts/offer_training.py --always
	@touch $@

$(VENV)/.test: $(VENV)/.run locks/test.txt locks/ldap.txt
	@STEP=5 $(BIN)/python $(LOCKED) locks/test.txt
	@$(DIRECTORY) || echo "Tests of log-in by LDAP are skipped: python-ldap cannot be compiled here (Debian: libldap2-dev, libsasl2-dev)"
	@touch $@

$(VENV)/.ldap: $(VENV)/.run locks/ldap.txt
	@scripts/system-packages.sh ldap
	@$(DIRECTORY)
	@touch $@

$(VENV)/.browser: $(VENV)/.test
	@scripts/system-packages.sh browser
	@touch $@

$(VENV)/.tools: $(VENV)/bin/python locks/tools.txt
	$(BIN)/python -m venv $(VENV)/tools
	@$(VENV)/tools/bin/python $(LOCKED) locks/tools.txt
	@touch $@

lock: $(VENV)/.tools ## locks/ and constraints.txt anew, after a change of dependencies (needs an index)
	PATH="$(CURDIR)/$(VENV)/tools/bin:$$PATH" $(VENV)/tools/bin/python scripts/lock.py

audit: $(VENV)/.tools ## known holes in what is locked (asks the index's list of them, so it needs the network)
	@for lock in run test training ldap; do echo "$$lock:"; $(VENV)/tools/bin/pip-audit --strict --require-hashes --disable-pip --requirement locks/$$lock.txt || exit 1; done
