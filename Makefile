# `make report` and `make test` each set up what they need, once, in .venv/.
PYTHON ?= python3.11
BIN := .venv/bin
# Compiled modules are kept: commands are started hundreds of times, and compiling is a third of that.
unexport PYTHONDONTWRITEBYTECODE
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: report test pytest test-slow test-engines test-python dist check docs bench soak fuzz clean

report: .venv/.report
	$(BIN)/crosscheck demo --out reports

# Two workers; a file's tests stay together, and files are dealt as they stand: the built-in systems last.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# The checks of the code run beside the tests. Motions with events are among the slow ones, and
# `make test-engines` runs all built-in models with every check; `gate --all` there, in all engines.
QUICK := mass_spring_damper simple_pendulum drum_pendulum
test: .venv/.test
	$(MAKE) --no-print-directory --jobs 2 check pytest

pytest: .venv/.test
	$(PYTEST) tests -m "not slow and not pinocchio" --require-engines --durations 10 \
		$(QUICK:%=--crosscheck models/%)

# Whole pages, files and matrices, each five seconds and more. Files without slow tests are not
# imported; the longest are dealt first.
LONG := $(addprefix tests/,installed/test_documents.py installed/test_installed.py \
	versions/test_two_versions.py cases/test_events.py laws/test_mistakes.py \
	faults/test_real_engines.py installed/test_repository.py test_site.py gate/test_kinds_of_change.py)
SLOW = $(LONG) $(filter-out $(LONG),$(shell grep -rl --include 'test_*.py' 'mark\.slow' tests))
test-slow: .venv/.test
	$(PYTEST) $(SLOW) -m slow

# Every engine of an extra: its tests, its conformance, and all accepted cases. 4 GB, 3 minutes to set up.
ALL := .venv-engines/bin
test-engines: .venv-engines/.ready
	REQUIRE_ALL_ENGINES=1 $(ALL)/python -m pytest -n 2 --dist loadfile tests/engines \
		tests/files/test_motions.py tests/numerics/test_stepping.py tests/numerics/test_forward_dynamics.py
	$(ALL)/python -m pytest -n 2 -m "mujoco or pybullet or pymunk or pinocchio" --crosscheck models \
		--crosscheck-thorough --ignore models/events models
	$(ALL)/crosscheck gate --all --out build/gate

# Another Python, with the engines that have wheels for it: make test-python PYTHON=python3.12
OTHER := .venv-$(notdir $(PYTHON))
test-python:
	$(PYTHON) -m venv $(OTHER)
	$(OTHER)/bin/python -m pip --disable-pip-version-check --quiet install \
		--constraint constraints.txt --editable '.[portable]'
	$(OTHER)/bin/python -m pytest -n 2 --dist loadfile -m "not slow" \
		tests/reference tests/robots tests/records tests/text tests/installed/test_installed.py
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

# What is attacked, and how: docs/reliability.md. An hour at most on two cores.
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

.venv/.docs: .venv/bin/python pyproject.toml constraints.txt
	$(PIP) install --constraint constraints.txt --editable '.[docs]'
	touch $@

.venv/.fuzz: .venv/.test
	$(PIP) install --constraint constraints.txt --editable '.[fuzz]'
	touch $@

clean:
	rm -rf .venv .venv-*
