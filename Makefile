# make setup | run | test | test-all | bench | clean; each of them sets up first whatever is missing.

BIN = .venv/bin

.PHONY: setup run test test-all bench clean

# GetDP and libraries (Debian packages), Python packages in .venv
setup:
	@scripts/setup.sh

# The first published case beside its reference numbers; tables and picture in out/a
run: setup
	$(BIN)/damjoint validate a

# The tests but for the minutes-long ones; all of them in CI
test: setup
	$(BIN)/pytest -q $(if $(CI),,-m "not heavy")

test-all: setup
	$(BIN)/pytest -q

# Twenty minutes; refreshes the tables and the picture that README.md shows
bench: setup
	$(BIN)/damjoint bench --readme README.md
	cp out/bench/accuracy.png reference/pictures/

# Results and caches
clean:
	rm -rf out .pytest_cache
	find scripts tests -name __pycache__ -prune -exec rm -rf {} +
