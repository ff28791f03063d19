# Targets of rotorfault; `make` alone lists them. Everything is installed into virtual environments in this folder.

# Windows, where make runs from Git Bash, has its own names for Python and for the folder of an environment's commands.
ifeq ($(OS),Windows_NT)
PYTHON ?= python
BIN := Scripts
else
PYTHON ?= python3
BIN := bin
endif
PIP := .venv/$(BIN)/python -m pip --disable-pip-version-check
NUMPY_PIP := .venv-numpy/$(BIN)/python -m pip --disable-pip-version-check
# Two test processes on two cores: more threads in BLAS only wait for each other.
export OPENBLAS_NUM_THREADS := 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help venv paper ranges test test-long test-numpy test-bounds web fuzz lint types bench peers maps frame-maps benchmarks docs \
  docs-long clean check-python

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "%-14s%s\n", $$1, $$2 }' $(MAKEFILE_LIST)

check-python:
	@command -v $(PYTHON) >/dev/null || { \
	  echo "No '$(PYTHON)' found. Install Python 3.11 or newer, or name one: make PYTHON=/path/to/python3.12 ..." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "rotorfault needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) --version 2>&1)." >&2; \
	  echo "Name a newer one: make PYTHON=/path/to/python3.12 ..." >&2; exit 1; }

# Two stamps: flying the paper's case needs rotorfault alone, working on it needs the tools too.
.venv/.stamp-fly: pyproject.toml constraints.txt | check-python
	$(PYTHON) -m venv .venv
	$(PIP) install --quiet -c constraints.txt -e .
	@touch $@

.venv/.stamp-develop: .venv/.stamp-fly
	$(PIP) install --quiet -c constraints.txt -e '.[test,dev,flightcode]'
	@touch $@

# Without llvmlite, as on systems that it has no wheels for. --no-deps, for rotorfault itself asks for it.
.venv-numpy/.stamp: pyproject.toml constraints.txt | check-python
	$(PYTHON) -m venv .venv-numpy
	grep -v -e '^llvmlite' -e '^heyoka' constraints.txt > .venv-numpy/requirements.txt
	$(NUMPY_PIP) install --quiet -r .venv-numpy/requirements.txt
	$(NUMPY_PIP) install --quiet --no-deps -e .
	@touch $@

venv: .venv/.stamp-develop ## Create .venv with rotorfault, the tests' and the developers' tools

paper: .venv/.stamp-fly ## Reproduce the paper: every case, figure, table and claim
	.venv/$(BIN)/rotorfault paper --out results/paper

ranges: .venv/.stamp-develop ## Search gains anew and give the paper's Table 1 as ranges (15 min on 2 idle cores)
	.venv/$(BIN)/rotorfault ranges --out results/ranges

test: .venv/.stamp-develop ## Run the tests but those that take long and the code of the pages
	.venv/$(BIN)/python -m pytest -n 2 --dist loadfile -m "not long and not pages"

test-long: .venv/.stamp-develop ## Run the tests that take long
	.venv/$(BIN)/python -m pytest -n 2 --dist loadfile -m long

# Where an engine is chosen. What reads files, draws, judges, counts or linearises is the same with and without a
# compiler, and so are the equations themselves, of which the tests of plant, autopilot and model ask.
NUMPY_TESTS := tests/campaigns/test_block.py tests/campaigns/test_run.py tests/cli tests/engine tests/flight tests/loop \
  tests/project/test_examples.py tests/reference/test_own_signals.py

test-numpy: .venv-numpy/.stamp ## Run the tests in which something flies without llvmlite, in .venv-numpy
	.venv-numpy/$(BIN)/python -m pytest -n 2 --dist loadfile -m "not long and not pages" $(NUMPY_TESTS)

# Both ends of every bound in pyproject.toml: the lowest versions that it allows, and the newest that there are.
BOUNDS_EXTRAS := flightcode,tune,cluster,export
BOUNDS_TOOLS := pytest pytest-xdist hypothesis duckdb pandas
BOUNDS_TESTS := tests/base tests/cli/test_main.py tests/results tests/reference tests/tuning tests/campaigns/store \
  tests/campaigns/report tests/engine/test_engines.py tests/engine/test_cache.py tests/maths

test-bounds: | check-python ## Run a quick part of the tests with the lowest versions allowed, then with the newest
	$(PYTHON) tools/bounds.py > .lowest.txt
	$(PYTHON) -m venv .venv-lowest && $(PYTHON) -m venv .venv-newest
	.venv-lowest/$(BIN)/python -m pip install --quiet -c .lowest.txt -e '.[$(BOUNDS_EXTRAS)]' $(BOUNDS_TOOLS)
	.venv-newest/$(BIN)/python -m pip install --quiet --upgrade -e '.[$(BOUNDS_EXTRAS)]' $(BOUNDS_TOOLS)
	.venv-lowest/$(BIN)/python -m pytest -n 2 $(BOUNDS_TESTS)
	.venv-newest/$(BIN)/python -m pytest -n 2 $(BOUNDS_TESTS)

web: ## Bundle the program of the flight page anew, after a change in web/ (needs Node.js; the bundle is committed)
	cd web && npm install --no-package-lock --no-audit --no-fund --silent && node build.mjs

fuzz: .venv/.stamp-develop ## Try 10,000 inputs that nobody meant, and print counts (COUNT=, FIRST= for others)
	.venv/$(BIN)/python tools/fuzz.py --count $(or $(COUNT),10000) --first $(or $(FIRST),1)

lint: .venv/.stamp-develop ## Check style and format with ruff
	.venv/$(BIN)/ruff check
	.venv/$(BIN)/ruff format --check

types: .venv/.stamp-develop ## Check types with mypy
	.venv/$(BIN)/mypy

.venv/.stamp-bench: .venv/.stamp-develop
	$(PIP) install --quiet -c constraints.txt -e '.[bench]'
	@touch $@

bench: .venv/.stamp-bench ## Measure speed and accuracy on this machine
	.venv/$(BIN)/rotorfault bench --json results/bench.json --figure results/error-cost.png

peers: .venv/.stamp-bench ## The same beside crazyflow, RotorPy and l2f (installs 8 GB on first use)
	.venv/$(BIN)/rotorfault bench --peers --json results/bench.json --figure results/error-cost.png

.venv/.stamp-docs: .venv/.stamp-develop
	$(PIP) install --quiet -c constraints.txt -e '.[docs]'
	@touch $@

docs: .venv/.stamp-docs ## Run the code of the pages and build the site in results/site, with its notebooks (3 min)
	.venv/$(BIN)/python -m pytest -n 2 -m pages tests/project/test_pages.py
	.venv/$(BIN)/python tools/docs_site/build.py

docs-long: .venv/.stamp-develop ## Run the code of all pages as it stands, with what takes long (an hour on 2 cores)
	ROTORFAULT_LONG_PAGES=1 .venv/$(BIN)/python -m pytest tests/project/test_pages.py

maps: .venv/.stamp-fly ## Fly the built-in survival campaigns
	for study in partial-loss-map two-rotors detection-worth mass-inertia; do \
	  .venv/$(BIN)/rotorfault campaign $$study --out results/campaigns/$$study || exit 1; done

frame-maps: .venv/.stamp-develop ## Fly what frames of six and eight rotors can lose (20 min on 2 cores; resumed if interrupted)
	.venv/$(BIN)/python tools/frame_maps.py

benchmarks: .venv/.stamp-develop ## Run every script in benchmarks/
	@for script in benchmarks/*.py; do \
	  [ -e "$$script" ] || { echo "There are no benchmarks yet."; break; }; \
	  echo "$$script"; .venv/$(BIN)/python "$$script" || exit 1; \
	done

clean: ## Remove what tools made; keeps the virtual environments and results
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +
