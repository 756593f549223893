# Starts from Python 3.11 or later, make and a package index; everything else goes into .venv.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: quickstart test check clean

quickstart: .venv/quickstart-installed
	$(BIN)/mpiexec -n 3 $(BIN)/python -m mpi4py -m gen run quick -o quick.h5
	$(BIN)/python -m gen info quick.h5
	$(BIN)/python -m gen plot quick.h5 -o quick.png

test: .venv/test-installed
	$(BIN)/python -m pytest

# What CI runs besides the two above.
check: .venv/test-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest bench --benchmark-disable

clean:
	rm -rf .venv build *.egg-info quick.h5 quick.png

.venv/quickstart-installed: .venv/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[mpich,plot]"
	touch $@

.venv/test-installed: .venv/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[test]"
	touch $@ .venv/quickstart-installed

.venv/bin/python:
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and \
	'Python 3.11 or later is needed, this is %d.%d: make PYTHON=python3.12 ...' % sys.version_info[:2])"
	$(PYTHON) -m venv .venv
