# `make demo` and `make test` each do everything on a machine that has only Python 3.11 or newer and make.
# Everything is installed into .venv; stamps in it make the second call instant.

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
PINNED := --constraint constraints.txt --build-constraint constraints.txt
PYTHON ?=
PYTEST_FLAGS ?= -n 2 --dist loadfile --no-loadscope-reorder  # in order: doctests, which are quick, come last
SYSTEM_FLAGS ?= -n 3 --dist loadfile --no-loadscope-reorder  # two workers leave 40 % of two cores idle: they wait for browsers
# extras that tests use; fem3d, which has no wheels on some machines, is in the group dev
EXTRAS := analysis,camera,cluster,console,curves,dicom,map,postgres,study
MANIFESTS := pyproject.toml constraints.txt

.DEFAULT_GOAL := help
.PHONY: help demo test peers test-system test-slow test-release test-sdist benchmark studies lint docs sbom release man tables extras constraints clean

help:  ## say what there is
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/:[^#]*##/\t/' | expand -t 14

demo: $(VENV)/.console  ## install, then press a virtual phantom and estimate its inclusion
	$(BIN)/tsis demo

# The tiers exclude each other: release, slow, system, and the quick tests that are left.
test: $(VENV)/.dev  ## install, then run the quick tests and all doctests: in process, no server, no browser
	$(BIN)/pytest $(PYTEST_FLAGS) -m "not system and not slow and not release"

peers: $(VENV)/.peers  ## real cameras' libraries for test-system; .ci/run lists Debian's packages

test-system: $(VENV)/.dev  ## the tests that start programs, browsers, cameras, PostgreSQL or judges of DICOM files
	$(BIN)/pytest $(SYSTEM_FLAGS) -m "system and not slow and not release" tests docs

test-slow: $(VENV)/.dev  ## the tests that take minutes
	$(BIN)/pytest $(PYTEST_FLAGS) -m "slow and not release"

test-release: $(VENV)/.release  ## fresh environments: the built wheel, installed and used
	$(BIN)/pytest -m release

benchmark: $(VENV)/.dev  ## speed and accuracy beside those of other programs, one process at a time
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.coverage --protocol domed --presses 500
	$(BIN)/python -m benchmarks.coverage --protocol flat --presses 500
	$(BIN)/python -m benchmarks.coverage --protocol flat-alone --presses 500
	$(BIN)/python -m benchmarks.tissue
	$(BIN)/python -m benchmarks.ablation --cases 12
	$(BIN)/python -m benchmarks.nine_inclusions
	$(BIN)/python -m benchmarks.simulation_based_calibration
	$(BIN)/python -m benchmarks.slow_reference
	$(BIN)/python -m benchmarks.mechanics
	$(BIN)/python -m benchmarks.domed_second_code
	$(BIN)/python -m benchmarks.rays
	$(BIN)/python -m benchmarks.sweep_overhead --empty 100000 --runs 3
	$(BIN)/python -m benchmarks.matching
	$(BIN)/python -m benchmarks.calibration_force --runs 500
	$(BIN)/python -m benchmarks.calibration_scale --runs 500
	$(BIN)/python -m benchmarks.press_guard
	$(BIN)/python -m benchmarks.hardness --probe tsis-direct --spheres 40 --rigs 5
	$(BIN)/python -m benchmarks.hardness --probe tsis-2011 --spheres 20 --rigs 5 --ball
	$(BIN)/python -m benchmarks.gel_hardness
	$(BIN)/python -m benchmarks.detection_intervals
	$(BIN)/python -m benchmarks.detection_study --targets 2000 --seed 1
	$(BIN)/python -m benchmarks.store_speed
	$(BIN)/python -m benchmarks.console

studies: $(VENV)/.dev $(VENV)/.docs  ## every figure and table of the dissertation anew, beside the printed ones
	$(BIN)/python -m studies.gallery
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html  # the gallery is docs/_build/html/figures.html

lint: $(VENV)/.dev  ## style, room boundaries and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy

docs: $(VENV)/.docs  ## the pages, into docs/_build/html; a warning is an error
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html

sbom: $(VENV)/.release  ## the software bill of materials, build/sbom.cdx.json, of the plain install and every extra
	$(BIN)/python release/bill_of_materials.py build/sbom.cdx.json

release: $(VENV)/.release sbom  ## rehearse a release: archives built twice and compared, hashes, metadata, bill of materials
	$(BIN)/python -m release.rehearse build/release
	cp build/sbom.cdx.json build/release/

PYTHONS ?= $(BIN)/python  # interpreters of test-sdist
test-sdist: release  ## the sdist's quick tests of the core packages on the installed wheel, in a fresh environment
	$(BIN)/python -m release.sdist_tests build/release $(addprefix --python ,$(PYTHONS))

man: $(VENV)/.dev  ## man pages of all commands, into build/man
	$(BIN)/python -m release.man_pages build/man

extras: $(VENV)/.release  ## what the plain install and each extra cost: packages, MB, seconds (a quarter of an hour)
	$(BIN)/python -m release.extras

tables: $(VENV)/.dev  ## compute the tables that ship with the package anew (half an hour)
	$(BIN)/python -m release.tables

constraints: $(VENV)/.pip  ## resolve every dependency afresh and write constraints.txt
	rm -rf build/fresh
	$(BIN)/python -m venv build/fresh
	build/fresh/bin/python -m pip install --quiet --upgrade pip
	build/fresh/bin/python -m pip install --quiet --editable ".[$(EXTRAS)]" --group dev --group peers --group docs --group release hatchling
	{ sed '/^[^#]/,$$d' constraints.txt; \
	  build/fresh/bin/python -m pip freeze --all --exclude-editable; } > build/constraints.txt
	mv build/constraints.txt constraints.txt
	rm -rf build/fresh

clean:  ## remove everything that the other targets made
	rm -rf $(VENV) build dist docs/_build .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

# Each recipe below makes its stamp last, so that a broken installation is tried again.

$(VENV)/.pip:
	@if $(BIN)/python -c 'import sys, pip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	  echo "using the environment in $(VENV)"; exit 0; \
	fi; \
	found=; bare=; \
	for candidate in $(PYTHON) python3 python3.14 python3.13 python3.12 python3.11 python; do \
	  "$$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || continue; \
	  if "$$candidate" -c 'import venv, ensurepip' 2>/dev/null; then found=$$candidate; break; fi; \
	  bare=$$candidate; \
	done; \
	if [ -z "$$found" ] && [ -n "$$bare" ]; then \
	  echo "$$bare cannot make virtual environments; install its venv package (Debian, Ubuntu: apt-get install python3-venv)" >&2; \
	  exit 1; \
	elif [ -z "$$found" ]; then \
	  echo "Python 3.11 or newer was not found; install it, or name it: make $(MAKECMDGOALS) PYTHON=/path/to/python3" >&2; \
	  exit 1; \
	fi; \
	echo "using $$("$$found" --version)"; \
	"$$found" -m venv --clear $(VENV)
	$(PIP) install --quiet --upgrade --constraint constraints.txt pip
	@touch $@

$(VENV)/.console: $(VENV)/.pip $(MANIFESTS)
	$(PIP) install --quiet $(PINNED) --editable ".[console]"
	@touch $@

$(VENV)/.dev: $(VENV)/.pip $(MANIFESTS)
	$(PIP) install --quiet $(PINNED) --editable ".[$(EXTRAS)]" --group dev
	@touch $@

$(VENV)/.peers: $(VENV)/.dev
	$(PIP) install --quiet $(PINNED) --group peers
	@touch $@

$(VENV)/.docs: $(VENV)/.dev  # one after the other: both install tsis itself
	$(PIP) install --quiet $(PINNED) --editable ".[$(EXTRAS)]" --group docs
	@touch $@

$(VENV)/.release: $(VENV)/.peers
	$(PIP) install --quiet $(PINNED) --group release
	@touch $@
