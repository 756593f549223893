# Starts from Python 3.11 or later, make and a package index; everything else goes into .venv.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: quickstart test test-all long docs figures slurm slurm-test campaign check browser calculix debian parallel test-parallel versions wheel clean

# Hundreds of processes import the same modules: they are compiled once, whatever the environment says.
unexport PYTHONDONTWRITEBYTECODE

quickstart: .venv/quickstart-installed
	$(BIN)/mpiexec -n 3 $(BIN)/python -m mpi4py -m gen run quick -o quick.h5
	$(BIN)/python -m gen info quick.h5
	$(BIN)/python -m gen plot quick.h5 -o quick.png
	@echo "Look at quick.png; go on with README.md, below 'After that'."

# On two processors; what takes long, the batch scripts' tests and the fault campaign stand apart. A test
# that hangs ends its process, and is not begun again in a new one.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --max-worker-restart 0
test: .venv/test-installed
	$(PYTEST) -m "not long and not slurm and not campaign"

# Everything, as CI runs it.
test-all: test long campaign slurm-test

# Properties over thousands of problems, and what only few changes can break.
long: .venv/test-installed
	$(PYTEST) -m "long and not slurm and not campaign"

# The manual, docs/_build/html/index.html: tables from bench/results, pictures drawn, the gallery run, links checked.
docs: .venv/docs-installed
	rm -rf docs/_build docs/api/generated
	OMP_NUM_THREADS=1 $(BIN)/sphinx-build --fail-on-warning --keep-going --fresh-env --write-all --quiet --jobs 2 docs docs/_build/html
	@echo "made: docs/_build/html/index.html"

# The picture of README.md, figures/quick.png, drawn anew: it shows times, so draw it on a quiet machine.
figures: .venv/quickstart-installed
	$(BIN)/python docs/extensions/pictures.py

# The batch scripts on a Slurm of their own, which is installed where root may do so, without services.
SLURM := munge slurmctld slurmd slurm-client libpmix2
slurm-test: .venv/test-installed slurm
	$(BIN)/python -m pytest tests/slurm

slurm:
	@dpkg -s $(SLURM) > /dev/null 2>&1 || test "$$(id -u)" != 0 || { apt-get update --quiet && \
	  DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 apt-get install --quiet --yes --no-install-recommends $(SLURM); }

# The short form of `python -m tests.faults`.
campaign: .venv/test-installed
	$(BIN)/python -m pytest tests/faults -m campaign

check: .venv/test-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/complexipy --plain
	$(BIN)/python -m pytest bench/suites --benchmark-disable
	$(BIN)/python -m tests.ledger

# The tests of bem, gen and learn where pyproject.toml says that they pass: with the lowest versions of what it
# names, on the oldest Python, and with the newest ones on every Python that is there. All come as wheels; only
# jsonpath-rw, which mlcroissant needs, has none. SKIPPED: Pythons that are not tried with the newest versions.
VERSIONS := .venv-versions
PYTHONS := $(shell sed -n 's/^ *"Programming Language :: Python :: \(3\.[0-9]*\)",/python\1/p' pyproject.toml)
SKIPPED ?=
versions: .venv/bin/python
	rm -rf $(VERSIONS)
	$(BIN)/python -m venv $(VERSIONS)/tools
	$(VERSIONS)/tools/bin/python -m pip install --quiet uv
	@passed=0; for run in lowest-direct/$(firstword $(PYTHONS)) $(addprefix highest/,$(filter-out $(SKIPPED),$(PYTHONS))); do \
	  python=$${run#*/}; environment=$(VERSIONS)/$$run; \
	  $$python -c "" 2> /dev/null || { echo "not tried on $$python: it is not on this machine"; continue; }; \
	  echo "$${run%/*} versions on $$python"; \
	  $$python -m venv --without-pip $$environment && \
	  $(VERSIONS)/tools/bin/uv pip install --quiet --python $$environment/bin/python --resolution $${run%/*} \
	    --only-binary :all: --no-binary asperity --no-binary jsonpath-rw --editable ".[suite]" && \
	  $$environment/bin/python -m pytest -n 2 --dist loadfile --max-worker-restart 0 --quiet \
	    -m "not long and not slurm and not campaign" tests/bem tests/gen tests/learn || exit 1; \
	  passed=$$((passed + 1)); \
	done; test $$passed -gt 0

# What people install: built, checked, alone in an environment, and tried in an empty folder.
WHEEL := build/wheel
LATER ?= python3.12 python3.13 python3.14
wheel: .venv/bin/python
	rm -rf build
	$(BIN)/python -m venv $(WHEEL)/tools
	$(WHEEL)/tools/bin/python -m pip install --quiet build twine cffconvert py-rattler-build "setuptools>=77"
	$(WHEEL)/tools/bin/python -c "import rattler_build as r; recipe = r.Stage0Recipe.from_file('recipe/recipe.yaml'); \
	  print(*recipe.render(r.VariantConfig(), r.RenderConfig()))"
	$(WHEEL)/tools/bin/python -m build --quiet --no-isolation --sdist --wheel --outdir $(WHEEL)/made
	$(WHEEL)/tools/bin/python -m twine check --strict $(WHEEL)/made/*
	$(WHEEL)/tools/bin/python -m pip wheel --quiet --no-deps --no-build-isolation \
	  --wheel-dir $(WHEEL)/from-sdist $(WHEEL)/made/*.tar.gz
	@for made in made from-sdist; do $(BIN)/python -m zipfile --list $(WHEEL)/$$made/*.whl | \
	  awk '!/commit.txt/ { print $$1 }' | sort > $(WHEEL)/$$made.txt; done
	diff $(WHEEL)/made.txt $(WHEEL)/from-sdist.txt
	$(WHEEL)/tools/bin/cffconvert --validate
	$(BIN)/python -m venv $(WHEEL)/installed
	$(WHEEL)/installed/bin/python -m pip install --quiet --no-compile "$$(ls $(WHEEL)/made/*.whl)[mpich,plot]"
	mkdir $(WHEEL)/empty
	cd $(WHEEL)/empty && export PATH="$(CURDIR)/$(WHEEL)/installed/bin:$$PATH" && set -x && \
	  asperity --version && \
	  mpiexec -n 3 asperity gen run quick -o quick.h5 && \
	  asperity gen check quick.h5 --recompute 4 && \
	  asperity gen plot quick.h5 -o quick.png && \
	  asperity learn --help && asperity bench --help
	@for python in $(LATER); do \
	  $$python -c "" 2> /dev/null || { echo "not tried on $$python: it is not on this machine"; continue; }; \
	  $$python -m venv $(WHEEL)/$$python && cd $(WHEEL)/$$python && \
	  bin/python -m pip install --quiet --no-compile "$$(ls ../made/*.whl)[learn]" && \
	  bin/asperity gen run quick -o quick.h5 && \
	  bin/asperity learn fit quick.h5 --features hybrid -o first.surrogate && cd - > /dev/null || exit 1; \
	done

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

# The finite-element program that reads the tables of laws.
calculix:
	@command -v ccx > /dev/null || { test "$$(id -u)" = 0 && apt-get update --quiet && \
	  DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends calculix-ccx; }

debian:
	@dpkg -s $(DEBIAN) > /dev/null 2>&1 || { test "$$(id -u)" = 0 && apt-get update --quiet && \
	  DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends $(DEBIAN); }

parallel: .venv-parallel/installed
	@echo "made: . .venv-parallel/bin/activate && mpiexec -n 9 python -m mpi4py -m gen run ..."

test-parallel: .venv-parallel/installed
	$(PARALLEL)/python -m pytest tests/mpi

clean:
	rm -rf .venv .venv-parallel .venv-versions build docs/_build docs/gallery docs/api/generated *.egg-info quick.h5 quick.png

.venv/quickstart-installed: .venv/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[mpich,plot]"
	touch $@

.venv/test-installed: .venv/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[test]"
	touch $@ .venv/quickstart-installed

.venv/docs-installed: .venv/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[docs]"
	touch $@ .venv/quickstart-installed

.venv/bin/python:
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and \
	'Python 3.11 or later is needed, this is %d.%d: make PYTHON=python3.12 ...' % sys.version_info[:2])"
	$(PYTHON) -m venv .venv

.venv-parallel/installed: export PATH := $(CURDIR)/$(PARALLEL):$(PATH)
.venv-parallel/installed: pyproject.toml
	@command -v mpicc.openmpi mpiexec.openmpi > /dev/null && test -d "$(HDF5)" || { echo \
	"make parallel needs packages of Debian: apt-get install --no-install-recommends $(DEBIAN)" \
	"(no Debian, no root: see docs/how-to/parallel-hdf5.md)"; exit 2; }
	$(PYTHON) -m venv .venv-parallel
	@printf '#!/bin/sh\nexec mpiexec.openmpi "$$@"\n' | tee $(PARALLEL)/mpiexec > $(PARALLEL)/mpirun
	chmod +x $(PARALLEL)/mpiexec $(PARALLEL)/mpirun
	python -m pip install --quiet --editable ".[mpi]" "pytest>=9.0" "hypothesis>=6.100" \
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
