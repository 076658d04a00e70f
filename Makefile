# make run    installs everything at pinned versions into .venv, predicts an example, then runs experiment=simstack
# make test   the same for the checks and tests, but those marked as exhaustive
# make quick  the same without tests that are marked as slow
# make test-all  all tests, as continuous integration runs them
# make docs   the documents as a site, outputs/site/index.html
#
# PYTHON=...       the Python to use (3.11 or newer)
# ARGS="..."       more overrides for `make run`, e.g. ARGS="run=predict input=view.npz"
# TORCH_INDEX=...  where pip takes torch from, e.g. the index of a CPU-only build
# PYTEST="..."     more options for pytest, e.g. PYTEST="-k voting"

PYTHON ?= python3
TORCH ?= torch==2.13.0
TORCH_INDEX ?=
ARGS ?=
PYTEST ?=

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# Of 20 000 modules most are never imported; Python compiles the others when they are.
PIP := $(BIN)/python -m pip install --disable-pip-version-check --quiet --no-compile --constraint constraints.txt
SYSTEM := libusb-1.0-0 libgl1 libgomp1
LOADABLE := import ctypes; [ctypes.CDLL(name) for name in \
	("libusb-1.0.so.0", "libGL.so.1", "libgomp.so.1")]
# Two test processes share the cores: their thread pools must not multiply, nor spin while they wait.
# Without bytecode every process would compile the sources anew.
THREADS := PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 OMP_WAIT_POLICY=PASSIVE OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=2

# Neighbouring tests share a process, and with it what they make once.
TESTS := $(THREADS) $(BIN)/python -m pytest -n 2 --dist worksteal

# Types are checked beside the tests, a browser is fetched beside Python's packages.
MAKEFLAGS += --jobs=2

.DELETE_ON_ERROR:
.PHONY: run test test-all quick tests docs lint types install python system browser clean help

run: install
ifeq ($(ARGS),)
	$(BIN)/python -m scenefw run=predict input=example paths.output=outputs/example
endif
	$(BIN)/python -m scenefw experiment=simstack $(ARGS)

test: CHOICE := -m "not exhaustive"
quick: CHOICE := -m "not slow and not exhaustive"

test quick test-all: types tests

tests: lint $(if $(filter test-all,$(MAKECMDGOALS)),browser)
	$(TESTS) $(CHOICE) $(PYTEST)

docs: install
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo outputs/site/index.html

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: install
	$(BIN)/mypy

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt | python system
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
	  { $(PYTHON) -m pip install --quiet --user virtualenv && $(PYTHON) -m virtualenv $(VENV); }
	$(PIP) $(if $(TORCH_INDEX),--index-url $(TORCH_INDEX)) "$(TORCH)"
	$(PIP) --editable ".[all,test,docs]"
	touch $@

python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "scenefw needs Python 3.11 or newer: make run PYTHON=/path/to/python3.11"; exit 1; }

# open3d, the peer in tests and benchmarks, loads these libraries.
system:
	@if $(PYTHON) -c '$(LOADABLE)' 2>/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  { apt-get update -qq && \
	    DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $(SYSTEM); } \
	  || echo "the tests against open3d need: apt-get install $(SYSTEM)"; \
	else echo "the tests against open3d need: sudo apt-get install $(SYSTEM)"; fi

# Pages are tested in Chromium, if it can be had.
browser: system
	@if command -v chromium >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  { apt-get update -qq && \
	    DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends chromium; } \
	  || echo "the tests of pages in a browser need: apt-get install chromium"; \
	else echo "the tests of pages in a browser need: sudo apt-get install chromium"; fi

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache

help:
	@sed -n 's/^# \?//p' Makefile | head -10
