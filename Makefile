# make setup | run | check | test | test-all | bench | pages | docs | clean; all but clean run setup
# first.
# PYTHON=python3.12 make setup chooses the interpreter.

BIN = .venv/bin
# each file of tests in one process, as its tests share computed scenes; in the order of their names,
# so that the unit tests, short files, come last and all processes end at about the same time
PARALLEL = --numprocesses auto --dist loadfile --no-loadscope-reorder
# types are checked by as many processes as there are cores
export MYPY_NUM_WORKERS = auto
# the processes that tests start read compiled modules: a run takes a third less
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup run check test test-all bench pages docs clean

# Install GetDP and libraries (Debian packages), and Python packages in .venv
setup:
	@scripts/setup.sh

# Run the first published case and compare it with its reference numbers; results in out/a
run: setup
	$(BIN)/damjoint validate a

# Check style and common errors
check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# Run the tests but the heavy ones; in CI all of them
test: check
	$(BIN)/pytest -q $(PARALLEL) $(if $(CI),,-m "not heavy")

test-all: check
	$(BIN)/pytest -q $(PARALLEL)

# Measure for half an hour (resumed if interrupted); update reference/benchmarks.md, its picture and
# the table of modelings in README.md
bench: setup
	$(BIN)/damjoint bench
	$(BIN)/python -m damjoint_tools.pages bench out/bench

# Make the pages in reference/ that come from the code or from runs: parameters.md, results.md,
# tour.md, ssnp142.md, published.md
pages: setup
	$(BIN)/python -m damjoint_tools.pages all

# Build the site out/site/index.html from the pages, the executed notebooks and the docstrings; a
# broken link is an error
docs: setup
	$(BIN)/sphinx-build -q -W --keep-going -E -c reference/site -d out/doctrees . out/site
	@echo out/site/index.html

# Remove results and caches
clean:
	rm -rf out .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find scripts tests -name __pycache__ -prune -exec rm -rf {} +
