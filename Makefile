# Set-up, the main job and the tests, each in one command.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CRATE := $(VENV)/crate-validator
# folders or files of tests, in place of all: make pytest TESTS=tests/unit
TESTS ?=
# one more than processors: a worker waits a fifth of its time, for servers, watchdogs and browsers
UV ?= uv
WORKERS ?= $(shell expr $$(nproc) + 1)
THREADS ?= $(shell nproc)  # of the type check
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
export PREFECT_SERVER_ANALYTICS_ENABLED = false
export DO_NOT_TRACK = 1
# empty: the tests start some hundred processes, whose modules and assertions are compiled once and kept
export PYTHONDONTWRITEBYTECODE =
export PYTHONS TESTS WORKERS

.PHONY: run test help check lint types layers pytest test-slow test-pythons debian clean locks locks-check uv bench release docs FORCE

run: $(VENV)/.run  ## set up and run the main job on the simulated station
	$(BIN)/tumbleline run || [ $$? -eq 1 ]  # 1: the run is done and a unit missed its limits, which is a result

# one thread of the type check beside the tests takes two thirds of the processor time of two before them
test: lint layers  ## set up, lint, types, layers and tests
	@$(MAKE) --no-print-directory -j 2 types pytest THREADS=1

help:  ## what can be made
	@sed -n 's/^\([a-z-]*\):.*  ## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12

check: lint types layers  ## what needs no test to be run

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/pyright --threads $(THREADS)

layers: $(VENV)/.dev
	$(BIN)/lint-imports

pytest: $(VENV)/.dev $(CRATE)/.done debian
	$(BIN)/python -m pytest -m "not slow" -n $(WORKERS) --dist worksteal $(TESTS)

test-slow: $(VENV)/.dev $(CRATE)/.done debian  ## suites that take minutes, an hour or two in all on two cores
	$(BIN)/python -m pytest -m slow -n $(shell nproc) --dist worksteal $(TESTS)

test-pythons:  ## set up, main job and tests in a fresh clone, for each Python that is found; or PYTHONS="python3.12 …", TESTS=tests/unit
	@$(PYTHON) -m deploy.pythons

bench: $(VENV)/.bench  ## benchmarks of docs/reference/measured.md in a short form
	$(BIN)/python -m benchmarks

release: $(VENV)/.dev  ## wheel, source distribution, bill of materials and hashes, into dist/
	$(BIN)/python -m deploy.release

docs: $(VENV)/.docs  ## the documents as a site that is searched without a network, into build/site/
	$(BIN)/python -m docs.build_site

debian:  ## programs of other makers that tests talk to: mbpoll, chromium
	@sh deploy/debian-packages.sh

# one line where the Python is not one that the locks are for; it is plain enough for any Python
SUPPORTED := import sys; sys.exit(0 if (3, 11) <= sys.version_info[:2] <= (3, 14) else "Python %d.%d is not supported, 3.11 to 3.14 is needed; say which, as in: make PYTHON=python3.13" % sys.version_info[:2])
# a Python that somebody names replaces the environment of another one; else the environment that is there is kept
ASKED := $(if $(filter file default undefined,$(origin PYTHON)),,--asked)

define set_up
	@with=$(PYTHON); \
	if [ -z "$(ASKED)" ] && $(BIN)/python -c '$(SUPPORTED)' 2>/dev/null; then with=$(BIN)/python; fi; \
	if ! command -v $$with >/dev/null; then echo "set-up: there is no program '$$with'; say which Python, as in: make PYTHON=python3.13" >&2; exit 1; fi; \
	$$with -c '$(SUPPORTED)' && $$with deploy/environment.py $(1) $(ASKED)
endef

# asked each time: the script knows whether something is to be done
$(VENV)/.run $(VENV)/.all $(VENV)/.dev $(VENV)/.bench $(VENV)/.docs: FORCE
	$(call set_up,$(patsubst .%,%,$(notdir $@)) $(VENV))

# a validator of another maker, in an environment of its own: it asks for older libraries than the product has
$(CRATE)/.done: FORCE | $(VENV)/.dev
	$(call set_up,crate $(CRATE))

FORCE:

# universal: one lock for every Python from 3.11 on, by markers; versions stay as they are unless UPGRADE=--upgrade is given
define lock
	$(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-strip-extras --no-emit-index-url --no-annotate --no-header \
		--override build/unused.in $(UPGRADE) $(4) $(patsubst %,--extra %,$(2)) $(patsubst %,--constraint requirements-%.lock,$(3)) --output-file requirements-$(1).lock
endef
CRATE_NEEDS := roc-validator>=0.13
USERS := build captures dask pdf recordings schedule signatures sql visa
# UNUSED of schemas/locks.py: what a library asks for and nothing of it here uses; tests use some of them themselves
UNUSED := numpydoc apprise matplotlib
define lock_without
	@printf '%s ; python_version < "3"\n' $(4) > build/unused.in
	$(call lock,$(1),$(2),$(3),pyproject.toml)
endef

locks: uv  ## resolve the locks anew (needs uv); UPGRADE=--upgrade moves versions
	$(call lock_without,run,build,,$(UNUSED) docker pytest)
	$(call lock_without,all,$(USERS),run,$(UNUSED) docker pytest)
	$(call lock_without,dev,$(USERS) dev,all,$(UNUSED))
	$(call lock_without,bench,$(USERS) dev bench,dev,$(UNUSED))
	$(call lock_without,docs,build docs,dev,$(UNUSED) docker pytest)
	@: > build/unused.in
	@echo '$(CRATE_NEEDS)' > build/crate.in
	$(call lock,crate,,,build/crate.in)
	@rm build/crate.in build/unused.in

locks-check: uv  ## resolve every lock for every Python, with wheels alone (needs uv and the index; installs nothing)
	@for lock in requirements-*.lock; do for python in 3.11 3.12 3.13 3.14; do \
		$(UV) pip install --quiet --dry-run --python-version $$python --only-binary :all: --require-hashes --target build/nothing -r $$lock \
		&& echo "$$lock holds for Python $$python" || exit 1; done; done

uv:
	@command -v $(UV) >/dev/null || { echo "locks: there is no program '$(UV)', which resolves them; install it, as with 'pipx install uv', or name it with UV=…" >&2; exit 1; }
	@mkdir -p build

clean:  ## take away what was made here, but no archive: it holds measurements
	rm -rf $(VENV) build dist *.egg-info .hypothesis .ruff_cache .import_linter_cache
