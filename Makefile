# `make demo` and `make test` need Python 3.11 or newer (with its venv), make and pip; nothing else.
PYTHON ?= python3
BIN := .venv/bin
PYTEST = $(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

.PHONY: demo test test-all check gate golden bench speed thesis results laser recordings studies fuzz stops soak docs release-check clean

demo: .venv/installed
	$(BIN)/maurice-replay demo --force

# Without the tests that are marked slow: a few minutes; `.ci/run` calls it.
test: .venv/installed-dev
	$(PYTEST) -m "not slow"

test-all: .venv/installed-dev .venv/installed-docs
	$(PYTEST)

# The sdist and the wheel, tried in a fresh environment, and the constraints for every Python: two minutes. CI runs it.
release-check: .venv/installed-dev
	$(BIN)/python -m pytest tests/test_release.py

check: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(PYTEST)

# A simulated drive that the default filter must localize on, with 20 seeds: under a minute; CI runs it (docs/trials.md).
gate: .venv/installed
	$(BIN)/maurice-replay simulate global --updates 40 -o out/gate/drive --force
	$(BIN)/maurice-replay check out/gate/drive/session.log --max-error 0.15m --localized-by 20 --min-localized 0.95 \
		--seeds 20 -o out/gate/check.xml --artifacts out/gate/failed --force

# What users are told of planted drives, written anew (tests/golden): the diff shows what changed, the commit says why.
golden: .venv/installed-dev
	$(BIN)/python -m pytest tests/golden --remake

# All comparisons with the peers, some minutes; the tables go into docs/performance.md.
bench: .venv/installed-dev
	$(BIN)/python -m benchmarks --write

# A few of them as ratios, which fails where one fell by half: two to three minutes; CI runs it.
speed: .venv/installed-dev
	$(BIN)/python -m benchmarks check

# The thesis's trials, figures and claims (docs/thesis.md): three quarters of an hour on two quiet cores, and it goes on where it stopped.
# QUICK=--quick shows in a minute that it works, in folders of its own, and writes no docs.
QUICK ?=
thesis: .venv/installed-dev
	$(BIN)/maurice-replay trials run thesis $(QUICK) -o out/trials/thesis$(QUICK) --resume
	$(BIN)/python -m benchmarks.thesis out/trials/thesis$(QUICK) -o out/thesis$(QUICK) $(or $(QUICK),--write)

# The tables of docs/results.md and docs/landmarks.md, on unseen arenas: hours, and they go on where they stopped.
# SEEDS=5 for fewer runs.
SEEDS ?=
PLANS := benchmarks/studies/plans
TRIALS_OF = $(BIN)/maurice-replay trials run $(PLANS)/$(1).toml -o out/trials/$(1) --resume $(if $(SEEDS),--seeds $(SEEDS))
results: .venv/installed-dev
	$(call TRIALS_OF,results)
	$(BIN)/python -m benchmarks.studies.results out/trials/results
	$(call TRIALS_OF,landmarks)
	$(BIN)/python -m benchmarks.studies.results out/trials/landmarks
	$(call TRIALS_OF,channels)
	$(call TRIALS_OF,landmarks-spacing)
	$(BIN)/python -m benchmarks.studies.landmark_figures out/trials/channels out/trials/landmarks-spacing -o docs/pictures

# A laser on your own recorded drives with true poses (docs/laser.md), with the tables of its page: minutes for
# four logs, and it goes on where it stopped. LOGS=DIR holds them, at any depth; SEEDS=5 for fewer runs; OUT=DIR
# for other logs than before.
LOGS ?= logs
laser: .venv/installed-dev
	$(BIN)/python -m benchmarks.studies.laser $(LOGS) $(if $(SEEDS),--seeds $(SEEDS)) $(if $(OUT),-o $(OUT))

# What features find in your own real pictures, and how filters do on your real drives (docs/real-recordings.md): a
# quarter of an hour for three sets, and it goes on where it stopped. RECORDINGS=DIR holds a folder for each set.
RECORDINGS ?= recordings
recordings: .venv/installed-dev
	$(BIN)/python -m benchmarks.studies.recordings $(RECORDINGS) $(if $(OUT),-o $(OUT))

# How often verdicts, signals and beliefs are right, on drives that nothing was fitted on: an hour; they go on where
# they stopped. STUDIES=causes for one of them (benchmarks/studies/README.md).
STUDIES ?= difficulty lost_signal belief causes laser_causes
studies: .venv/installed-dev
	set -e; for study in $(STUDIES); do $(BIN)/python -m benchmarks.studies.$$study; done

# 200,000 inputs for what reads session logs, CMUcam dumps and live sources: minutes, and it goes on where it stopped.
# INPUTS=N for another number.
INPUTS ?= 200000
fuzz: .venv/installed-dev
	$(BIN)/python tests/fuzz/fuzz_all.py --inputs $(INPUTS)

# Commands stopped, killed or out of room at 120 random moments: half an hour, and it goes on where it stopped.
# TRIALS=N for another number.
TRIALS ?= 120
stops: .venv/installed-dev
	$(BIN)/python tests/fuzz/stop_all.py --trials $(TRIALS)

# Two hours of robot time from a live source, drawn and recorded: does memory stay where it is?
soak: .venv/installed-dev
	$(BIN)/python -m benchmarks.speed.soak

# The documentation as a site, into site/; strict, and without a network.
docs: .venv/installed-docs
	$(BIN)/mkdocs build --strict

# An editable install, so that what is edited is what runs; a stale build/ would bring deleted files back.
.venv/installed: pyproject.toml constraints.txt
	rm -rf build
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable .
	touch $@

.venv/installed-dev: .venv/installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@

.venv/installed-docs: .venv/installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

# All that the targets write, as .gitignore names it; out/ holds trials of hours.
clean:
	rm -rf .venv .venv-peers build dist out site *.egg-info *.rrd .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
