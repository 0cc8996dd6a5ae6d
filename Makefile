# The project's commands. `make demo` and `make test` are all that a newcomer needs.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PROFILE ?= paper-table
DATA ?= activecam-data

.PHONY: demo test lint format serve bench clean

demo: $(VENV)/.installed ## A full calibration of the paper's simulated table, in the terminal
	$(BIN)/activecam demo

test: $(VENV)/.installed-dev ## All tests but the slow suites
	$(BIN)/python -m pytest -n 2 --dist loadfile

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

$(VENV)/bin/python:
	scripts/make-venv "$(PYTHON)" "$(VENV)"

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --editable . --constraint constraints.txt
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[dev]' --constraint constraints.txt
	touch $@

clean: ## Take away what was installed and cached here
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
