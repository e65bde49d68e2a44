# Set-up, the main job and the tests, each in one command.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CRATE := $(VENV)/crate-validator
# one more than processors: a worker waits a fifth of its time, for servers, watchdogs and browsers
WORKERS ?= $(shell expr $$(nproc) + 1)
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
export PREFECT_SERVER_ANALYTICS_ENABLED = false
export DO_NOT_TRACK = 1
# empty: the tests start some hundred processes, whose modules and assertions are compiled once and kept
export PYTHONDONTWRITEBYTECODE =

.PHONY: run test help check lint types layers pytest test-slow debian clean locks bench release docs

run: $(VENV)/.run  ## set up and run the main job on the simulated station
	$(BIN)/tumbleline run || [ $$? -eq 1 ]  # 1: the run is done and a unit missed its limits, which is a result

test: check pytest  ## set up, lint, types, layers and tests

help:  ## what can be made
	@sed -n 's/^\([a-z-]*\):.*  ## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12

check: lint types layers  ## what needs no test to be run

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/pyright

layers: $(VENV)/.dev
	$(BIN)/lint-imports

pytest: $(VENV)/.dev $(CRATE)/.done debian
	$(BIN)/python -m pytest -m "not slow" -n $(WORKERS) --dist worksteal

test-slow: $(VENV)/.dev $(CRATE)/.done debian  ## suites that take minutes
	$(BIN)/python -m pytest -m slow

bench: $(VENV)/.bench  ## figures of docs/reference/measured.md in a short form
	$(BIN)/python -m benchmarks

release: $(VENV)/.dev  ## wheel, source distribution, bill of materials and hashes, into dist/
	$(BIN)/python -m deploy.release

docs: $(VENV)/.docs  ## the documents as a site that is searched without a network, into build/site/
	$(BIN)/python -m docs.build_site

debian:  ## programs of other makers that tests talk to: mbpoll, chromium
	@sh deploy/debian-packages.sh

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed; set PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)

# the lock is complete: without resolving, older pips cannot stumble over extras that a pinned package is asked for with
# compiled on all processors, and not the tests of the libraries, which nobody runs here: an eleventh of the size
define install
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-compile --require-hashes -r $(1)
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@$(BIN)/python -m compileall -qq -j 0 -x '/tests?/' $$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))') || true
	@touch $@
endef

$(VENV)/.run: requirements-run.lock pyproject.toml | $(VENV)/bin/python
	$(call install,requirements-run.lock)
	@$(BIN)/pip uninstall --quiet --yes setuptools  # it has built the editable install, and nothing runs it

$(VENV)/.dev: requirements-dev.lock pyproject.toml | $(VENV)/bin/python
	$(call install,requirements-dev.lock)
	@touch $(VENV)/.run

$(VENV)/.bench: requirements-bench.lock pyproject.toml | $(VENV)/bin/python
	$(call install,requirements-bench.lock)
	@touch $(VENV)/.run $(VENV)/.dev

$(VENV)/.docs: requirements-docs.lock pyproject.toml | $(VENV)/bin/python
	$(call install,requirements-docs.lock)

# a validator of another maker, in an environment of its own: it asks for older libraries than the product has
$(CRATE)/.done: requirements-crate.lock | $(VENV)/bin/python
	$(PYTHON) -m venv $(CRATE)
	$(CRATE)/bin/pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r requirements-crate.lock
	@touch $@

locks:  ## resolve the locks anew (needs uv)
	uv pip compile pyproject.toml --extra build --python-version 3.11 --generate-hashes --no-strip-extras --no-emit-index-url --no-annotate --no-header -o requirements-run.lock
	uv pip compile pyproject.toml --extra build --extra dev --extra pdf --extra recordings --extra signatures --python-version 3.11 --generate-hashes --no-strip-extras --no-emit-index-url --no-annotate --no-header -o requirements-dev.lock
	uv pip compile pyproject.toml --extra build --extra dev --extra pdf --extra recordings --extra signatures --extra bench --python-version 3.11 --generate-hashes --no-strip-extras --no-emit-index-url --no-annotate --no-header -o requirements-bench.lock
	uv pip compile pyproject.toml --extra build --extra docs --python-version 3.11 --generate-hashes --no-strip-extras --no-emit-index-url --no-annotate --no-header -o requirements-docs.lock
	echo 'roc-validator>=0.13' | uv pip compile - --python-version 3.11 --generate-hashes --no-strip-extras --no-emit-index-url --no-annotate --no-header -o requirements-crate.lock

clean:  ## take away what was made here, but no archive: it holds measurements
	rm -rf $(VENV) build dist *.egg-info .hypothesis .ruff_cache .import_linter_cache
