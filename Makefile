# `make report` and `make test` each set up what they need, once, in .venv/.
PYTHON ?= python3.11
BIN := .venv/bin
# Compiled modules are kept: commands are started hundreds of times, and compiling is a third of that.
unexport PYTHONDONTWRITEBYTECODE
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: report test pytest test-slow test-release test-engines test-physx test-python dist check docs bench soak fuzz clean

report: .venv/.report
	$(BIN)/crosscheck demo --out reports

# Three workers fill two cores; a file's tests stay together, and files are dealt as they stand: the
# built-in systems last.
WORKERS := -n 3 --dist loadfile --no-loadscope-reorder
PYTEST := $(BIN)/python -m pytest $(WORKERS)

# The checks of the code run beside the tests. `make test-engines` runs all built-in models with
# every check, motions with events among them; `gate --all` there, in all engines.
QUICK := mass_spring_damper simple_pendulum drum_pendulum
test: .venv/.test
	$(MAKE) --no-print-directory --jobs 2 check pytest

pytest: .venv/.test
	$(PYTEST) tests -m "not slow and not release and not pinocchio" --require-engines --durations 10 \
		$(QUICK:%=--crosscheck models/%)

# Whole files and matrices, each five seconds and more. Files without such tests are not imported;
# the longest are dealt first.
LONG := $(wildcard $(addprefix tests/,cases/test_events.py laws/test_whole_step.py \
	laws/test_mistakes.py scaffold/test_new_bodies.py \
	diagnosis/test_random_draws.py schedule/test_cluster.py))
marked = $(shell grep -rl --include 'test_*.py' 'mark\.$(1)' tests)
test-slow: .venv/.test
	$(PYTEST) $(LONG) $(filter-out $(LONG),$(call marked,slow)) -m slow

# What is published: the wheel, pages run line by line, the site, and two versions of an engine.
LONG_RELEASE := $(wildcard $(addprefix tests/,installed/test_documents.py versions/test_two_versions.py \
	installed/test_repository.py installed/test_installed.py test_site.py))
test-release: .venv/.test
	$(PYTEST) $(LONG_RELEASE) $(filter-out $(LONG_RELEASE),$(call marked,release)) -m release

# Impacts that have no limit or lose their rebound, and a lost contact: docs/method-events.md.
KNOWN := bouncing_ball/system.py::bouncing_ball/robot.urdf/drop \
	bouncing_ball/system.py::bouncing_ball/robot.urdf/thrown \
	pendulum_stop/system.py::pendulum_stop/robot.urdf/swing \
	tipping_box/system.py::tipping_box/space.py/rock

# Every engine of `all-engines`: its tests, its conformance, and all accepted cases. 4 GB, 3 minutes to set up.
ALL := .venv-engines/bin
test-engines: .venv-engines/.ready
	REQUIRE_ALL_ENGINES=1 $(ALL)/python -m pytest -n 2 --dist loadfile tests/engines \
		tests/files/test_motions.py tests/laws/test_contacts.py tests/numerics/test_stepping.py \
		tests/scaffold/test_new_sdf.py
	$(ALL)/python -m pytest -n 2 -m "mujoco or pybullet or pymunk or pinocchio" --crosscheck models \
		--crosscheck-thorough $(KNOWN:%=--deselect 'models/events/%') models
	$(ALL)/crosscheck gate --all --out build/gate

# PhysX, whose license keeps it out of `all-engines`: its conformance, page and tests. 1.2 GB. Its
# metadata ask for an older packaging than pytest's, so it comes last and without dependencies.
PHYSX := .venv-physx/bin
test-physx: .venv-physx/.ready
	REQUIRE_PHYSX=1 $(PHYSX)/python -m pytest -n 2 --dist loadfile tests/engines/test_extras_physx.py \
		tests/engines/test_conformance.py tests/engines/test_pages.py -k physx

# Another Python, with the engines that have wheels for it: make test-python PYTHON=python3.12
# The wheel is tested there too, so `release` is not left out.
OTHER := .venv-$(notdir $(PYTHON))
test-python:
	$(PYTHON) -m venv $(OTHER)
	$(OTHER)/bin/python -m pip --disable-pip-version-check --quiet install \
		--constraint constraints.txt --editable '.[portable]'
	$(OTHER)/bin/python -m pytest $(WORKERS) -m "not slow" tests/installed/test_installed.py \
		tests/reference tests/robots tests/records tests/text
	$(OTHER)/bin/crosscheck demo --engine mujoco --engine pymunk --out build/$(OTHER)

# The wheel comes from the source distribution, as it does where people build it.
dist: .venv/.test
	rm -rf dist build/sdist
	$(BIN)/python -m hatchling build -t sdist -d dist
	mkdir -p build/sdist && tar -xzf dist/*.tar.gz -C build/sdist --strip-components 1
	cd build/sdist && $(CURDIR)/$(BIN)/python -m hatchling build -t wheel -d $(CURDIR)/dist

check: .venv/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The documentation as a site, build/site/index.html.
docs: .venv/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

bench: .venv/.report
	$(BIN)/python -m benchmarks.bench

# What is attacked, and how: docs/measured.md. An hour at most on two cores.
soak: .venv/.test
	$(BIN)/python -m soak

# Coverage-guided fuzzing of the parsers; an hour on one core.
fuzz: .venv/.fuzz
	$(BIN)/python -m soak.fuzz --seconds 3600

.venv/bin/python:
	$(PYTHON) -m venv .venv

.venv/.report: .venv/bin/python pyproject.toml constraints.txt
	$(PIP) install --constraint constraints.txt --editable '.[engines]'
	touch $@

.venv/.test: .venv/bin/python pyproject.toml constraints.txt
	$(PIP) install --constraint constraints.txt --editable '.[dev]'
	touch $@ .venv/.report

.venv-engines/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-engines
	$(ALL)/python -m pip --disable-pip-version-check --quiet install \
		--constraint constraints.txt --editable '.[dev,all-engines]'
	touch $@

.venv-physx/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-physx
	$(PHYSX)/python -m pip --disable-pip-version-check --quiet install --constraint constraints.txt \
		--editable '.[usd]' pytest pytest-xdist physx-usd-schemas warp-lang
	$(PHYSX)/python -m pip --disable-pip-version-check --quiet install --constraint constraints.txt \
		--no-deps ovphysx ovstage
	touch $@

.venv/.docs: .venv/bin/python pyproject.toml constraints.txt
	$(PIP) install --constraint constraints.txt --editable '.[docs]'
	touch $@

.venv/.fuzz: .venv/.test
	$(PIP) install --constraint constraints.txt --editable '.[fuzz]'
	touch $@

clean:
	rm -rf .venv .venv-*
