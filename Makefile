# `make demo` and `make test` need no preparation: they create the environment in .venv, with ROS 2
# from PyPI, or with the installed ROS 2 where it is sourced. Nothing outside this folder is changed;
# `make clean` removes everything that make has created inside it.

SHELL := /bin/bash
.SHELLFLAGS := -e -o pipefail -c
.DELETE_ON_ERROR:
.PHONY: bags bench bench-identify bench-loop bench-node bench-planned bench-replay clean demo demo-loop demo-ship \
  docs docs-site environment lint test

# PYTHON=... chooses another one. The ROS wheels are built for these versions.
PYTHONS := $(or $(PYTHON),python3 python3.12 python3.13 python3.11 python3.10)
SUITABLE := import ensurepip, sys, venv; sys.exit(not (3, 10) <= sys.version_info < (3, 14))

# The node needs this module; releases before Jazzy lack it and get the wheels, too.
ROS := $(if $(ROS_DISTRO),$(shell python3 -Bc 'import rclpy.experimental' >/dev/null 2>&1 || echo no),no)

ifeq ($(ROS),)
ROS := $(ROS_DISTRO)
# ROS's own modules are for the system's Python and need more of its modules.
PYTHONS := python3
VENV_OPTIONS := --system-site-packages
REQUIREMENTS := requirements.txt
else
ROS := pypi
REQUIREMENTS := requirements.txt requirements-ros.txt
# Variables of another ROS installation, or of another environment with these wheels.
ifneq ($(ROS_DISTRO)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE AMENT_PREFIX_PATH LD_LIBRARY_PATH RMW_IMPLEMENTATION
endif
unexport PYTHONPATH
endif
unexport PYTHONHOME
# Compiled modules are kept in .cache whatever the shell says: it halves the start of a program.
unexport PYTHONDONTWRITEBYTECODE

# Programs write here instead of into the home folder.
CACHE := $(CURDIR)/.cache
export COLCON_HOME := $(CACHE)/colcon
export HYPOTHESIS_STORAGE_DIRECTORY := $(CACHE)/hypothesis
export MPLCONFIGDIR := $(CACHE)/matplotlib
export PIP_CACHE_DIR := $(CACHE)/pip
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PYTHONPYCACHEPREFIX := $(CACHE)/pycache
export ROS_HOME := $(CACHE)/ros
export ROS_LOG_DIR := $(CACHE)/ros/log
export XDG_CACHE_HOME := $(CACHE)

# Processes that run the tests.
TESTERS := 4

PIP := .venv/bin/python -m pip --quiet
# One stamp for each kind of environment, with and without a sourced ROS.
DEPENDENCIES := .venv/dependencies-$(ROS)
INSTALLED := .venv/installed-$(ROS)

# More processes than cores: tests with ROS wait half of the time. One module, one process.
test: lint
	.venv/bin/python -m pytest --numprocesses $(TESTERS) --dist loadfile --no-loadscope-reorder

lint: $(INSTALLED)
	.venv/bin/python -m ruff check --quiet .
	.venv/bin/python -m flake8
	.venv/bin/python -m mypy
	.venv/bin/lint-imports --no-logo --cache-dir $(CACHE)/import_linter

demo: $(INSTALLED)
	@.venv/bin/python demo/demo.py

demo-loop: $(INSTALLED)
	@.venv/bin/python demo/loop.py

demo-ship: $(INSTALLED)
	@.venv/bin/python demo/ship.py

bench: $(INSTALLED)
	.venv/bin/python benchmarks/bench.py --write

bench-loop: $(INSTALLED)
	.venv/bin/python benchmarks/simulator.py --write

bench-node: $(INSTALLED)
	.venv/bin/python benchmarks/node.py --write
	.venv/bin/python benchmarks/rates.py --write

bench-identify: $(INSTALLED)
	.venv/bin/python benchmarks/identification.py --write

bench-planned: $(INSTALLED)
	.venv/bin/python benchmarks/planned.py --write

bench-replay: $(INSTALLED)
	.venv/bin/python benchmarks/replay.py --write

bags: $(INSTALLED)
	.venv/bin/python bags/record.py

# The pictures and the generated tables in README.md and docs/.
docs: $(INSTALLED)
	.venv/bin/python docs/figures/misprints.py
	.venv/bin/python docs/figures/draw.py
	.venv/bin/python docs/figures/tables.py

# The pages as a site: docs/_build/html/index.html.
docs-site: $(INSTALLED)
	.venv/bin/python -m sphinx --fresh-env --write-all --fail-on-warning --keep-going --quiet \
	  docs docs/_build/html
	@echo 'file://$(CURDIR)/docs/_build/html/index.html'

# With all machine code, which takes half a minute on two cores.
environment: $(INSTALLED)
	@.venv/bin/stewart_dynamics --compile

$(DEPENDENCIES): $(REQUIREMENTS)
	@for python in $(PYTHONS); do \
	  if "$$python" -c '$(SUITABLE)' 2>/dev/null; then found=$$python; break; fi; \
	done; \
	if [ -z "$$found" ]; then \
	  echo 'make: found no CPython 3.10 to 3.13 that has venv and ensurepip (on Ubuntu:' \
	    'apt install python3-venv); PYTHON=... names one' >&2; \
	  exit 1; \
	fi; \
	echo "making .venv with $$("$$found" --version), ROS from $(ROS)"; \
	"$$found" -m venv --clear $(VENV_OPTIONS) .venv
	@cat $(REQUIREMENTS) > .venv/requirements.txt
	@$(PIP) install --upgrade --constraint .venv/requirements.txt pip setuptools
	@$(PIP) install --no-build-isolation --requirement .venv/requirements.txt
	@touch $@

# Not isolated: the build uses the pinned setuptools. It warns of every editable package that has a
# folder of its own name.
$(INSTALLED): $(DEPENDENCIES) setup.py setup.cfg pyproject.toml
	@PYTHONWARNINGS=ignore $(PIP) install --no-build-isolation --no-deps --editable .
	@touch $@

clean:
	rm -rf .cache .venv build docs/_build install log *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
