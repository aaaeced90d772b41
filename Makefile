# `make demo` and `make test` do all the set-up themselves: virtual environment, packages, browser.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test test-fast check format bench bench-cabinet bench-floor bench-feet bench-whose bench-names bench-meetings bench-places floor-pictures bench-hand bench-slam bench-threads bench-localise bench-light bench-semidynamic bench-semidynamic-paper faults fuzz realdata peers clean help

help:
	@echo "make demo      run the demo until Ctrl-C"
	@echo "make test      set up and run all tests (SQLite, PostgreSQL, Chromium)"
	@echo "make check     ruff, mypy strict, import arrows"
	@echo "make bench     the published numbers of docs/benchmarks.md"
	@echo "make bench-hand     right and wrong grasps of the hand agent (docs/hand.md)"
	@echo "make bench-cabinet  the smart cabinet on simulated boards (docs/cabinet_position.png)"
	@echo "make bench-floor    floor sensing on simulated rooms (FLOOR='--quick' for a few minutes)"
	@echo "make bench-feet     whose foot has landed, decision by decision (FEET='--fit' fits the numbers behind it)"
	@echo "make bench-whose    how likely the costs of feet make what is right (WHOSE='--fit' fits them again)"
	@echo "make bench-names    how likely people who met are told to have been exchanged, and how often they were"
	@echo "make bench-meetings who is told to have stood with whom, and who did"
	@echo "make bench-places   where people in shoes are told to be, and the fit of the numbers behind it"
	@echo "make floor-pictures tracks of recordings of real people (docs/floor_tracks)"
	@echo "make bench-slam     laser mapping on public logs and simulated buildings (SLAM='--only logs')"
	@echo "make bench-threads  laser mapping with one and with two threads, by the clock on the wall"
	@echo "make bench-localise  localisation from anywhere in known maps (LOCALISE='--worlds intel')"
	@echo "make bench-light    received light in mapping, on simulated places (LIGHT='--places corridor')"
	@echo "make bench-semidynamic  moved doors and bins: path, objects, map (SEMIDYNAMIC='--worlds long --drives 50:52')"
	@echo "make bench-semidynamic-paper  our method beside the paper's (SEMIDYNAMIC='--worlds short')"
	@echo "make faults    the long fault tests (30 kills and more)"
	@echo "make peers     tests against programs of other people (installs tshark)"
	@echo "make fuzz      a million random and mutated inputs to every parser of device bytes, any scans to the floor estimator"

demo: $(READY)
	$(BIN)/tms demo $(DEMO)

test: $(READY) chromium check
	$(BIN)/python -m pytest -n $(or $(TEST_JOBS),2) $(PYTEST)

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/test_arrows.py

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY)
	$(BIN)/python benchmarks/placement.py
	$(BIN)/python benchmarks/ingest.py

bench-hand: $(READY)
	$(BIN)/python benchmarks/hand.py

bench-cabinet: $(READY)
	$(BIN)/python benchmarks/cabinet.py

bench-floor: $(READY)
	$(BIN)/python benchmarks/floor.py $(FLOOR)

bench-feet: $(READY)
	$(BIN)/python benchmarks/floor_feet.py $(FEET)

bench-whose: $(READY)
	$(BIN)/python benchmarks/floor_whose.py $(WHOSE)

bench-names: $(READY)
	$(BIN)/python benchmarks/floor_names.py $(NAMES)

bench-meetings: $(READY)
	$(BIN)/python benchmarks/floor_meetings.py $(MEETINGS)

bench-places: $(READY)
	$(BIN)/python benchmarks/floor_places.py

floor-pictures: $(READY)
	$(BIN)/python benchmarks/floor_pictures.py

bench-slam: $(READY)
	$(BIN)/python benchmarks/slam.py $(SLAM)

# Alone on the computer: wall time.
bench-threads: $(READY)
	$(BIN)/python benchmarks/slam.py --only threads

bench-localise: $(READY)
	$(BIN)/python benchmarks/localise.py $(LOCALISE)

bench-light: $(READY)
	$(BIN)/python benchmarks/light.py $(LIGHT)

bench-semidynamic: $(READY)
	$(BIN)/python benchmarks/semidynamic.py $(SEMIDYNAMIC)

bench-semidynamic-paper: $(READY)
	$(BIN)/python benchmarks/semidynamic_paper.py $(SEMIDYNAMIC)

faults: $(READY)
	TMS_KILLS=30 $(BIN)/python -m pytest -q --timeout 1800 tests/faults

fuzz: $(READY)
	$(BIN)/python benchmarks/fuzz_devices.py $(FUZZ)
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(VENV)/checked TMS_ROOMS=$(or $(ROOMS),300) $(BIN)/python -m pytest -q --timeout 1800 tests/agents/floor/test_any_scans.py

realdata: $(READY)
	$(BIN)/python -m pytest -q -m realdata

# Programs of other people judge ours: Debian's tshark, installed where it is missing.
peers: $(READY)
	@command -v tshark >/dev/null || { \
	  [ "$$(id -u)" = 0 ] && SUDO= || SUDO=sudo; \
	  echo "installing tshark"; $$SUDO apt-get update -qq && \
	  DEBIAN_FRONTEND=noninteractive $$SUDO apt-get install -y -qq --no-install-recommends tshark >/dev/null; }
	$(BIN)/python -m pytest -q -m peer

# The page is tested in a real browser: Debian's chromium, installed where it is missing.
.PHONY: chromium
chromium:
	@command -v chromium >/dev/null || { \
	  [ "$$(id -u)" = 0 ] && SUDO= || SUDO=sudo; \
	  echo "installing chromium"; $$SUDO apt-get update -qq && \
	  DEBIAN_FRONTEND=noninteractive $$SUDO apt-get install -y -qq --no-install-recommends chromium fonts-noto-cjk >/dev/null; }

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) .tms .hypothesis .pytest_cache .mypy_cache .ruff_cache
