# make setup | run | check | test | test-all | bench | pages | clean; each sets up first what is missing.
# PYTHON=python3.12 make setup chooses the interpreter.

BIN = .venv/bin
# a file of tests in one process, as its tests share what they have computed
PARALLEL = --numprocesses auto --dist loadfile

.PHONY: setup run check test test-all bench pages clean

# GetDP and libraries (Debian packages), Python packages in .venv
setup:
	@scripts/setup.sh

# The first published case beside its reference numbers; tables and picture in out/a
run: setup
	$(BIN)/damjoint validate a

# Style and what a look at the code can tell
check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# The tests but for the minutes-long ones; all of them in CI
test: check
	$(BIN)/pytest -q $(PARALLEL) $(if $(CI),,-m "not heavy")

test-all: check
	$(BIN)/pytest -q $(PARALLEL)

# Half an hour, which an interruption does not cost again; refreshes reference/benchmarks.md, its
# picture and the modelings' table in README.md
bench: setup
	$(BIN)/damjoint bench
	$(BIN)/python -m damjoint_tools.pages bench out/bench

# What is made from the code: reference/parameters.md, results.md; ssnp142.md from a validation of all cases
pages: setup
	$(BIN)/python -m damjoint_tools.pages all

# Results and caches
clean:
	rm -rf out .pytest_cache .ruff_cache .hypothesis
	find scripts tests -name __pycache__ -prune -exec rm -rf {} +
