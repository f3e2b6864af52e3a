# `make` alone tells what there is.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
EPISODES ?= 20

.DEFAULT_GOAL := help
.PHONY: help run study test lint types bench calibrations coverage budget chaos fuzz frontier policies speculation docs clean

help:  ## Show this help
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

run: $(VENV)/run.stamp  ## Land the trained LunarLander policy on ibm_lima's noise model
	$(BIN)/qcompile run lunarlander --backend ibm_lima --shots 8192 --episodes $(EPISODES)

study: $(VENV)/run.stamp  ## Repeat the paper's training study into docs/ (hours; resumes where it stopped)
	$(BIN)/qcompile study paper --out docs/study --page docs/background/reproduction.md

test: $(VENV)/dev.stamp  ## Run the tests
	$(BIN)/pytest -n 2

lint: $(VENV)/dev.stamp  ## Check style and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/dev.stamp  ## Check types
	$(BIN)/mypy

bench: $(VENV)/bench.stamp  ## Measure speed and errors beside the peers, in one run
	$(BIN)/python benchmarks/peers.py
	$(BIN)/python benchmarks/reading.py
	$(BIN)/python benchmarks/mitigation.py
	$(BIN)/python benchmarks/training.py
	$(BIN)/python benchmarks/entangled.py
	$(BIN)/python benchmarks/products.py
	$(BIN)/python -W ignore benchmarks/late.py

calibrations: $(VENV)/dev.stamp  ## Measure fits, false alarms, p-values and power of calibrations (minutes)
	$(BIN)/python benchmarks/calibration.py

coverage: $(VENV)/run.stamp  ## Measure how often 95 % intervals hold the mean (ten minutes)
	$(BIN)/python -W ignore benchmarks/coverage.py --samples 600

budget: $(VENV)/dev.stamp  ## Measure what live episodes cost and earn, by the ledger of a stand-in of IBM's service (an hour)
	$(BIN)/python benchmarks/budget.py --out docs/budget/stand-in.json

chaos: $(VENV)/dev.stamp  ## Break live runs in every known way, and check what they tell (half an hour)
	$(BIN)/python benchmarks/chaos.py

fuzz: $(VENV)/dev.stamp  ## Feed a million damaged files to all readers (minutes)
	$(BIN)/python -W ignore benchmarks/fuzz.py --inputs 1000000

frontier: $(VENV)/run.stamp  ## Measure reward against QPU seconds over shots, holds and devices (minutes)
	$(BIN)/python -W ignore benchmarks/frontier.py

policies: $(VENV)/run.stamp  ## Train the shipped policies by their cards, and compare every number (twenty minutes)
	$(BIN)/python benchmarks/shipped.py

speculation: $(VENV)/dev.stamp  ## Hold runs that measure ahead to the law of those that do not (half an hour)
	$(BIN)/python -W ignore benchmarks/speculation.py

docs: $(VENV)/docs.stamp  ## Build the documentation into site/
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet docs site
	@echo "the documentation is in site/index.html"

clean:  ## Remove what make made
	rm -rf $(VENV) site dist

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing qcompile and what it needs into $(VENV) (some minutes the first time)"
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(VENV)/dev.stamp: pyproject.toml constraints.txt $(VENV)/run.stamp
	@echo "installing the development tools into $(VENV)"
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	@touch $@

$(VENV)/bench.stamp: pyproject.toml constraints.txt $(VENV)/dev.stamp
	@echo "installing the peers of the benchmarks into $(VENV)"
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[bench]"
	@touch $@

$(VENV)/docs.stamp: pyproject.toml constraints.txt $(VENV)/run.stamp
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[docs]"
	@touch $@
