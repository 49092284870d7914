# `make demo` and `make test` need no preparation: they create the environment in .venv, with ROS 2
# from PyPI, or with the installed ROS 2 where it is sourced. Nothing outside this folder is changed;
# `make clean` removes everything that make has created inside it.

SHELL := /bin/bash
.SHELLFLAGS := -e -o pipefail -c
.DELETE_ON_ERROR:
.PHONY: bags bench bench-calibrate bench-capability bench-coverage bench-export bench-gpu bench-identify bench-lack-of-fit bench-loop bench-node bench-planned \
  bench-replay bench-response clean demo demo-calibrate demo-cueing demo-identify demo-loop demo-mujoco demo-ship demo-tune docs docs-site export-demo installed \
  lint lint-flake8 lint-forms lint-layers lint-mypy lint-pep257 lint-ruff pytest test test-gpu test-release tools wheels

# PYTHON=... chooses another one. The ROS wheels are built for these versions; the package admits 3.14, too.
PYTHONS := $(or $(PYTHON),python3 python3.12 python3.13 python3.11 python3.10)
SUITABLE := import ensurepip, sys, venv; sys.exit(not (3, 10) <= sys.version_info < (3, 14))

# ROS=kilted is ROS 2 Kilted from PyPI, in an environment of its own. Without it, what is sourced:
# the node needs this module; releases before Jazzy lack it and get the wheels, too.
ifneq ($(filter-out kilted,$(if $(filter command,$(origin ROS)),$(ROS))),)
$(error ROS=$(ROS): must be kilted, or not given)
endif
ROS := $(if $(ROS_DISTRO),$(shell python3 -Bc 'import rclpy.experimental' >/dev/null 2>&1 || echo no),no)

ifeq ($(ROS),)
ROS := $(ROS_DISTRO)
# ROS's own modules are for the system's Python and need more of its modules.
PYTHONS := python3
VENV_OPTIONS := --system-site-packages
REQUIREMENTS := requirements.txt
else ifeq ($(ROS),kilted)
REQUIREMENTS := requirements.txt requirements-kilted.txt
else
ROS := pypi
REQUIREMENTS := requirements.txt requirements-ros.txt
endif

# DEPENDENCIES=newest, =oldest: the newest or the oldest versions that setup.py admits, without ROS, in
# an environment of its own, and for each PYTHON=... Without it, the newest or the oldest Python that
# is found, also by pyenv; the oldest versions are those that have wheels for it.
VERSIONS := $(if $(filter command,$(origin DEPENDENCIES)),$(DEPENDENCIES))
ifneq ($(filter-out newest oldest,$(VERSIONS)),)
$(error DEPENDENCIES=$(VERSIONS): must be newest or oldest, or not given)
endif
ifneq ($(VERSIONS),)
ROS := none
VENV_OPTIONS :=
REQUIREMENTS := setup.py .ci/setup_requirements.py
SUITABLE := $(subst 14,15,$(SUITABLE))
PYTHONS := $(or $(PYTHON),$(foreach version,$(if $(filter oldest,$(VERSIONS)),10 11 12 13 14,14 13 12 11 10), \
  python3.$(version) $(wildcard $(HOME)/.pyenv/versions/3.$(version).*/bin/python3.$(version))) python3)
endif

ifneq ($(filter pypi kilted none,$(ROS)),)
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

VENV := .venv$(if $(filter kilted,$(ROS)),-kilted)$(if $(VERSIONS),-$(VERSIONS)$(if $(PYTHON),-$(notdir $(PYTHON))))
PIP := $(VENV)/bin/python -m pip --quiet
# One stamp for each kind of environment, with and without a sourced ROS.
PREPARED := $(VENV)/dependencies-$(ROS)
INSTALLED := $(VENV)/installed-$(ROS)
# And with the tools of tests, linters, benchmarks and pages.
TOOLS := $(VENV)/tools-$(ROS)

# Without the tests that take seconds, one more of a kind or of the whole (marker `slow`): those are left to
# `make test-release`. Linters, which look at the pinned environment alone, run beside.
test: SELECTED := -m 'not slow'
test test-release: $(TOOLS)
	@$(MAKE) --no-print-directory --jobs 2 pytest $(if $(VERSIONS),,$(LINTERS)) SELECTED="$(SELECTED)"

# More processes than cores: one half of them waits for ROS, the other half computes. One module, one
# process. Tests that run make are no part of this one.
pytest: $(TOOLS)
	env -u MAKEFLAGS $(VENV)/bin/python -m pytest --numprocesses $(TESTERS) --dist loadfile --no-loadscope-reorder $(SELECTED)

# On a computer with a GPU; CuPy is of no use to the others. The figures: make bench-gpu.
test-gpu: $(TOOLS)
	@$(VENV)/bin/python -c 'import cupy' 2> /dev/null || $(PIP) install --requirement requirements-gpu.txt
	$(VENV)/bin/python -m pytest test/test_gpu_on_device.py test/test_gpu.py test/test_hexapod_env.py

LINTERS := lint-mypy lint-flake8 lint-pep257 lint-ruff lint-layers lint-forms

# Beside one another: mypy and flake8 take nearly the same time.
lint: $(TOOLS)
	@$(MAKE) --no-print-directory --jobs --output-sync $(LINTERS)

lint-flake8: $(TOOLS)
	$(VENV)/bin/python -m flake8

# Forms of GitHub and the citation, against their schemas, which come with the tool.
lint-forms: $(TOOLS)
	@$(VENV)/bin/check-jsonschema --quiet --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/*.yml
	@$(VENV)/bin/check-jsonschema --quiet --builtin-schema vendor.citation-file-format CITATION.cff

lint-layers: $(TOOLS)
	$(VENV)/bin/lint-imports --no-logo --cache-dir $(CACHE)/import_linter

lint-mypy: $(TOOLS)
	$(VENV)/bin/python -m mypy

# Its list of all files is printed only where it finds something.
lint-pep257: $(TOOLS)
	@mkdir -p $(CACHE)
	@$(VENV)/bin/ament_pep257 setup.py $(filter-out build/ install/ log/,$(wildcard */)) \
	  > $(CACHE)/pep257 2>&1 || { grep -v ^checking $(CACHE)/pep257; false; }

lint-ruff: $(TOOLS)
	$(VENV)/bin/python -m ruff check --quiet .

demo: $(INSTALLED)
	@$(VENV)/bin/python demo/demo.py

demo-cueing: $(INSTALLED)
	@$(VENV)/bin/python demo/cueing.py $(if $(LEGS),--legs $(LEGS))

# LEGS=crank: six gear motors with cranks in place of telescopic legs.
demo-loop: $(INSTALLED)
	@$(VENV)/bin/python demo/loop.py $(if $(LEGS),--legs $(LEGS))

demo-mujoco: $(INSTALLED)
	@$(VENV)/bin/python demo/mujoco_loop.py

demo-ship: $(INSTALLED)
	@$(VENV)/bin/python demo/ship.py

# Gymnasium is one of the tools.
demo-tune: $(TOOLS)
	@$(VENV)/bin/python demo/tune.py

demo-calibrate: $(INSTALLED)
	@$(VENV)/bin/python demo/calibrate.py

demo-identify: $(INSTALLED)
	@$(VENV)/bin/python demo/identify.py

export-demo: $(INSTALLED)
	@$(VENV)/bin/python demo/export.py

bench: $(TOOLS)
	$(VENV)/bin/python benchmarks/bench.py --write

bench-capability: $(TOOLS)
	$(VENV)/bin/python benchmarks/capability.py --write

bench-export: $(TOOLS)
	$(VENV)/bin/python benchmarks/exported_source.py --write

bench-gpu: $(TOOLS)
	@$(VENV)/bin/python -c 'import cupy' 2> /dev/null || $(PIP) install --requirement requirements-gpu.txt
	$(VENV)/bin/python benchmarks/gpu.py --write

bench-loop: $(TOOLS)
	$(VENV)/bin/python benchmarks/simulator.py --write

bench-node: $(TOOLS)
	$(VENV)/bin/python benchmarks/node.py --write
	$(VENV)/bin/python benchmarks/rates.py --write

bench-identify: $(TOOLS)
	$(VENV)/bin/python benchmarks/identification.py --write

bench-calibrate: $(TOOLS)
	$(VENV)/bin/python benchmarks/calibration.py --write

bench-coverage: $(TOOLS)
	$(VENV)/bin/python benchmarks/interval_coverage.py --write
	$(VENV)/bin/python benchmarks/interval_coverage.py --table --write

bench-response: $(TOOLS)
	$(VENV)/bin/python benchmarks/response.py --write

bench-lack-of-fit: $(TOOLS)
	$(VENV)/bin/python benchmarks/lack_of_fit.py --write

bench-planned: $(TOOLS)
	$(VENV)/bin/python benchmarks/planned.py --write

bench-replay: $(TOOLS)
	$(VENV)/bin/python benchmarks/replay.py --write

bags: $(INSTALLED)
	$(VENV)/bin/python bags/record.py

# The pictures and the generated tables in README.md and docs/, and the outputs of the notebooks.
docs: $(TOOLS)
	$(VENV)/bin/python docs/figures/errata.py
	$(VENV)/bin/python docs/figures/draw.py
	$(VENV)/bin/python docs/figures/moving.py
	$(VENV)/bin/python docs/figures/badges.py
	$(VENV)/bin/python docs/figures/hexapod.py
	$(VENV)/bin/python docs/figures/cranks.py
	$(VENV)/bin/python docs/figures/tables.py
	$(VENV)/bin/python demo/cueing.py --output docs/figures/motion_cueing.png
	$(VENV)/bin/python -m jupyter execute --inplace examples/notebooks/*.ipynb

# The pages as a site: docs/_build/html/index.html.
docs-site: $(TOOLS)
	$(VENV)/bin/python -m sphinx -E -a -W --keep-going -q \
	  docs docs/_build/html
	@echo 'file://$(CURDIR)/docs/_build/html/index.html'

installed: $(INSTALLED)

tools: $(TOOLS)

$(PREPARED): $(REQUIREMENTS)
	@for python in $(PYTHONS); do \
	  if "$$python" -c '$(SUITABLE)' 2>/dev/null; then found=$$python; break; fi; \
	done; \
	if [ -z "$$found" ]; then \
	  echo 'make: found no CPython 3.10 to 3.13 that has venv and ensurepip (on Ubuntu:' \
	    'apt install python3-venv); PYTHON=... names one' >&2; \
	  exit 1; \
	fi; \
	echo "making $(VENV) with $$("$$found" --version), ROS from $(ROS)"; \
	"$$found" -m venv --clear $(VENV_OPTIONS) $(VENV)
ifeq ($(VERSIONS),)
	@cat $(REQUIREMENTS) > $(VENV)/requirements.txt
else
	@$(PIP) install --upgrade packaging pip setuptools
	@$(VENV)/bin/python .ci/setup_requirements.py $(VERSIONS) > $(VENV)/requirements.txt
	@echo lark >> $(VENV)/requirements.txt  # for FMPy: otherwise in the ROS wheels
endif
	@$(PIP) install --upgrade --constraint $(VENV)/requirements.txt pip setuptools
	@$(PIP) install --no-build-isolation --requirement $(VENV)/requirements.txt
	@touch $@

# Without a C compiler, the one of this package is used.
ZIG := ziglang==0.17.1
CORE := $(wildcard stewart_dynamics/core/*.[ch])

# Not isolated: the build uses the pinned setuptools. It warns of every editable package that has a
# folder of its own name.
$(INSTALLED): $(PREPARED) setup.py setup.cfg pyproject.toml $(CORE)
	@echo '#include <math.h>' | $${CC:-cc} -E -x c - > /dev/null 2>&1 || $(PIP) install $(ZIG)
	@PYTHONWARNINGS=ignore $(PIP) install --no-build-isolation --no-deps --editable .
	@touch $@

$(TOOLS): $(INSTALLED) requirements-test.txt requirements-fmi.txt
ifeq ($(VERSIONS),)
	@$(PIP) install --no-build-isolation --constraint $(VENV)/requirements.txt --requirement requirements-test.txt
endif
	@$(PIP) install --no-deps --requirement requirements-fmi.txt
	@touch $@

# A wheel for each system of setup.py, without compilers of these systems.
wheels:
	@$(if $(PYTHON),$(PYTHON),python3) -m venv --clear .venv-wheels
	@.venv-wheels/bin/python -m pip --quiet install $(ZIG) 'setuptools>=70.1'
	@for system in $$(.venv-wheels/bin/python -c \
	  'import re; print(*re.findall("^    .(\w+).: .\w+-", open("setup.py").read(), re.M))'); do \
	  echo "wheelhouse: $$system"; WHEEL_PLATFORM=$$system .venv-wheels/bin/python -m pip --quiet wheel \
	    --no-build-isolation --no-deps --wheel-dir wheelhouse .; \
	done

clean:
	rm -rf .cache .venv .venv-* build wheelhouse docs/_build install log *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
