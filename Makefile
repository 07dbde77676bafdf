PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# Bytecode is kept, since many tests start the command; each of the two processes has one core.
PYTEST := PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal

.PHONY: view test test-slow check docs bench models mutation clean

view: $(VENV)/.installed
	$(BIN)/inspector view

test: $(VENV)/.installed-dev
	@sh tests/install-system-packages.sh
	$(PYTEST) -m "not slow"

test-slow: $(VENV)/.installed-dev
	$(PYTEST) -m slow

check: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/.installed-dev
	$(BIN)/python -m sphinx -W --keep-going -q -E docs build/site
	@echo "build/site/index.html"

bench: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks $(BENCH)

models: $(VENV)/.installed-dev
	$(BIN)/python models/build.py

mutation: $(VENV)/.installed-dev
	$(BIN)/python -m pip install --quiet --editable ".[dev,mutation]"
	$(BIN)/python -m benchmarks.mutation build/mutation

clean:
	rm -rf $(VENV)

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	@touch $@ $(VENV)/.installed
