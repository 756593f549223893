# Starts from Python 3.11 or later, make and a package index; everything else goes into .venv.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: quickstart test slurm-test campaign check browser debian parallel test-parallel clean

quickstart: .venv/quickstart-installed
	$(BIN)/mpiexec -n 3 $(BIN)/python -m mpi4py -m gen run quick -o quick.h5
	$(BIN)/python -m gen info quick.h5
	$(BIN)/python -m gen plot quick.h5 -o quick.png
	@echo "Look at quick.png; go on with README.md, below 'After that'."

# On two processors; the batch scripts' tests and the fault campaign stand apart.
test: .venv/test-installed
	$(BIN)/python -m pytest -m "not slurm and not campaign" -n 2 --dist loadfile

# The batch scripts on a Slurm of their own, which is installed where root may do so.
slurm-test: .venv/test-installed
	$(BIN)/python -m pytest tests/slurm

# The short form of `python -m tests.faults`.
campaign: .venv/test-installed
	$(BIN)/python -m pytest -m campaign

check: .venv/test-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest bench/suites --benchmark-disable
	$(BIN)/python -m tests.ledger

# On Debian: .venv-parallel, in which h5py writes from all MPI ranks. No wheel does that: h5py is
# built once for these versions of Debian's HDF5 and Open MPI, and its wheel is kept in WHEELS.
WHEELS ?= $(HOME)/.cache/asperity-wheels
PARALLEL := .venv-parallel/bin
DEBIAN := libhdf5-openmpi-dev openmpi-bin gcc python3-dev
HDF5 = $(firstword $(wildcard /usr/lib/*/hdf5/openmpi))

# The browser that the page of reports is looked at in, without a window.
browser:
	@dpkg -s chromium > /dev/null 2>&1 || { test "$$(id -u)" = 0 && apt-get update --quiet && \
	  DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends chromium; }

debian:
	@dpkg -s $(DEBIAN) > /dev/null 2>&1 || { test "$$(id -u)" = 0 && apt-get update --quiet && \
	  DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends $(DEBIAN); }

parallel: .venv-parallel/installed
	@echo "made: . .venv-parallel/bin/activate && mpiexec -n 9 python -m mpi4py -m gen run ..."

test-parallel: .venv-parallel/installed
	$(PARALLEL)/python -m pytest tests/mpi

clean:
	rm -rf .venv .venv-parallel build *.egg-info quick.h5 quick.png

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

.venv-parallel/installed: export PATH := $(CURDIR)/$(PARALLEL):$(PATH)
.venv-parallel/installed: pyproject.toml
	@command -v mpicc.openmpi mpiexec.openmpi > /dev/null && test -d "$(HDF5)" || { echo \
	"make parallel needs packages of Debian: apt-get install --no-install-recommends $(DEBIAN)" \
	"(no Debian, no root: see Parallel HDF5 in the README)"; exit 2; }
	$(PYTHON) -m venv .venv-parallel
	@printf '#!/bin/sh\nexec mpiexec.openmpi "$$@"\n' | tee $(PARALLEL)/mpiexec > $(PARALLEL)/mpirun
	chmod +x $(PARALLEL)/mpiexec $(PARALLEL)/mpirun
	python -m pip install --quiet --editable ".[mpi]" "pytest>=8.2" "hypothesis>=6.100" \
	  cython pkgconfig "setuptools>=77"
	@set -e; \
	h5py=$$(python -c "from importlib.metadata import version; print(version('h5py'))"); \
	mpi4py=$$(python -c "from importlib.metadata import version; print(version('mpi4py'))"); \
	tag=$$(python -c "import sys; print('cp%d%d' % sys.version_info[:2])"); \
	hdf5=$$(dpkg-query -W -f '$${Version}' libhdf5-openmpi-dev); \
	openmpi=$$(dpkg-query -W -f '$${Version}' libopenmpi-dev); \
	kept="$(WHEELS)/mpi4py-$$mpi4py-hdf5-$$hdf5-openmpi-$$openmpi"; \
	if ! ls "$$kept/h5py-$$h5py-$$tag"-*.whl > /dev/null 2>&1; then \
	  echo "building h5py $$h5py with MPI: minutes, the first time"; \
	  CC=mpicc.openmpi HDF5_MPI=ON HDF5_DIR=$(HDF5) python -m pip wheel --quiet --wheel-dir "$$kept" \
	    --no-build-isolation --no-deps --no-cache-dir --no-binary=h5py "h5py==$$h5py"; \
	fi; \
	python -m pip install --quiet --force-reinstall --no-deps "$$kept/h5py-$$h5py-$$tag"-*.whl
	@python -c "import h5py, sys; sys.exit(not h5py.get_config().mpi and 'this h5py has no MPI')"
	touch $@
