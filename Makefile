# The project's commands. `make demo` and `make test` are all that a newcomer needs.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PEERS := .venv-peers
PROFILE ?= paper-table
DATA ?= activecam-data
FUZZ_EXAMPLES ?= 300
SOAK_MINUTES ?= 60
SCREENSHOTS ?= screenshots

.PHONY: demo test test-kernel test-kill test-fuzz soak lint format serve bench bench-peers screenshots figures clean

demo: $(VENV)/.installed ## A full calibration of the paper's simulated table, in the terminal
	$(BIN)/activecam demo

# Three workers for two processors, since many tests wait for what moves at the pace of life.
test: $(VENV)/.installed-dev ## All tests but the slow suites
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder

test-kernel: $(VENV)/.installed-dev ## The drivers against real kernel devices, in a virtual machine that VMRUN (a command) runs its arguments in
	@test -n "$(VMRUN)" || { echo "make test-kernel: say what runs a command in a virtual machine, VMRUN=..."; exit 2; }
	$(VMRUN) --udev --timeout 1800 $(BIN)/python -m pytest -p no:cacheprovider tests/kernel

test-kill: $(VENV)/.installed-dev ## Daemons killed at 200 random moments of runs, and disks that fill at 40: what was found each time
	$(BIN)/python -m tests.daemon.kills 200
	$(BIN)/python -m tests.daemon.full_disks 40

test-fuzz: $(VENV)/.installed-dev ## Clients, devices and disks that do anything at any time, FUZZ_EXAMPLES times
	FUZZ_EXAMPLES=$(FUZZ_EXAMPLES) $(BIN)/python -m pytest --timeout 0 tests/daemon/fuzz

soak: $(VENV)/.installed-dev ## Back-to-back runs with clients that come and go, for SOAK_MINUTES: what the daemon takes, and whether that grows
	$(BIN)/python -m tests.daemon.soak $(SOAK_MINUTES)

lint: $(VENV)/.installed-dev ## Style, types, and who imports whom
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/.installed-dev ## Bring the code into the project's form
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

serve: $(VENV)/.installed ## The daemon on PROFILE, with its data in DATA
	$(BIN)/activecam serve --profile $(PROFILE) --data $(DATA)

bench: $(VENV)/.installed-dev ## What we claim about accuracy and speed, measured
	$(BIN)/python -m benchmarks

screenshots: $(VENV)/.installed-dev ## The page in each of its states, as PNG in SCREENSHOTS
	$(BIN)/python -m tests.browser.screenshots $(SCREENSHOTS)

bench-peers: $(VENV)/.installed-dev $(PEERS)/.installed ## The calibration beside other packages, which need an environment of their own
	$(BIN)/python -m benchmarks peers

figures: $(VENV)/.installed-dev ## The documentation's measured figures, drawn anew
	$(BIN)/python -m benchmarks.uncertainty_figure docs/explanation/uncertainty.svg

$(VENV)/bin/python:
	scripts/make-venv "$(PYTHON)" "$(VENV)"

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --editable . --constraint constraints.txt
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[dev]' --constraint constraints.txt
	touch $@

$(PEERS)/.installed: benchmarks/peers-requirements.txt
	scripts/make-venv "$(PYTHON)" "$(PEERS)"
	$(PEERS)/bin/python -m pip install --quiet --requirement $<
	touch $@

clean: ## Take away what was installed and cached here
	rm -rf $(VENV) $(PEERS) .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache .npm-for-tests
