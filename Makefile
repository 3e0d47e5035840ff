.DEFAULT_GOAL := help
# On Windows make is to be called from Git Bash.
WINDOWS := $(filter Windows_NT,$(OS))
PYTHON ?= $(if $(WINDOWS),python,python3)
ROOM ?= bedroom
ARGS ?=
BIN := .venv/$(if $(WINDOWS),Scripts,bin)
DATA ?= data
REAL = $(foreach source,floorplans designer_rooms,$(if $(wildcard $(DATA)/$(source)),$(source)=$(DATA)/$(source)))
OPTIONS = $(if $(budget),budget=$(budget)) $(ARGS)
TYPES = $(if $(filter file,$(origin ROOM)),,room=$(ROOM))
# What Python and pytest compile is kept, whatever the shell says: compiling the tests takes a worker longer than importing.
PYTEST = PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --maxprocesses=4 --dist=worksteal

help:  ## show this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-8s %s\n", $$1, $$2}'

setup: .venv/ready  ## create .venv and install the project with its dev extra

.venv/ready: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

train: setup  ## train and score an agent: make train ROOM=bedroom ARGS="budget=smoke seed=1"
	$(BIN)/python -m layoutrl.train room=$(ROOM) $(OPTIONS)

test: setup  ## run the tests, up to four at once
	$(PYTEST)

search: setup  ## try the properties on new random examples: make search seconds=90
	$(PYTEST) -m hypothesis --hypothesis-profile=search --seconds=$(or $(seconds),90)

fuzz: setup  ## the same on ten times as many, and read 38,000 broken files: half an hour
	$(PYTEST) -m 'slow or hypothesis' --hypothesis-profile=fuzz

lint: setup  ## ruff (lint and format) and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: setup  ## measure speed and memory, see conf/bench.yaml: make bench ARGS="parts=[training]"
	$(BIN)/python -m layoutrl.bench room=$(ROOM) $(OPTIONS)

demo: setup  ## a page to try it on, at http://127.0.0.1:8765
	$(BIN)/python -m layoutrl.demo $(ARGS)

tables: setup  ## the paper's tables, and real rooms: make tables ROOM=kitchen budget=smoke DATA=data
	@status=0; trap 'exit 130' INT; \
	$(BIN)/python experiments/table1.py $(TYPES) $(OPTIONS) || status=1; \
	$(BIN)/python experiments/table2.py $(TYPES) $(OPTIONS) || status=1; \
	$(BIN)/python experiments/table3.py $(filter designer_rooms=%,$(REAL)) $(TYPES) $(OPTIONS) || status=1; \
	$(BIN)/python experiments/real_rooms.py $(REAL) $(TYPES) $(OPTIONS) || status=1; \
	exit $$status

notebooks: setup  ## run the notebooks, and keep what they show
	$(BIN)/python notebooks/run.py

docs: setup  ## build the API reference into docs/api
	$(BIN)/python -W error docs/reference.py

board: setup  ## TensorBoard on all runs
	$(BIN)/tensorboard --logdir runs

clean:  ## remove the environment and caches; keeps runs
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .hypothesis

.PHONY: help setup train test search fuzz lint bench demo tables notebooks docs board clean
