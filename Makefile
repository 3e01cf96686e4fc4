PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
FUZZ_SECONDS ?= 600
DEMO_OUT := out/demo
# a file's tests share what they build; in the order of tests/conftest.py. As many processes as
# cores: threads for matrices would wait for each other, and modules are compiled for all processes
PYTEST := OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= \
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder
# the slowest tests only where they are asked for, as test-all and continuous integration do
PFSC_TESTS ?= quick
SELECTED := $(if $(filter all,$(PFSC_TESTS)),,-m "not slow")

.PHONY: help setup demo test test-all lint types unit fuzz benchmark models docs signals architecture results gallery clean

help:
	@echo "make setup      create $(VENV) and install the project with its tools and $(BIN)/pfsc"
	@echo "make demo       run the six-axis elastic path following demo into $(DEMO_OUT)"
	@echo "make test       linters, types and the tests, but those that take longest"
	@echo "make test-all   the same with these; as continuous integration runs it"
	@echo "make fuzz       try wrong input for FUZZ_SECONDS=$(FUZZ_SECONDS) or until something is found"
	@echo "make benchmark  measure the controller tick"
	@echo "make docs       build the site in out/site, its notebooks executed"
	@echo "make signals    write docs/reference/signals.md anew from reporting/registry.toml"
	@echo "make architecture  draw docs/images/architecture.svg anew"
	@echo "make results    run all shipped scenarios and write the table of docs/results.md"
	@echo "make gallery    draw docs/images/gallery/ and the README's picture anew; needs Chromium"
	@echo "make models     write the robot models anew from their parameters"

setup: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; found $$($(PYTHON) --version). Try: make PYTHON=python3.11"; exit 1; }
	@echo "Setting up $(VENV); downloads about 500 MB the first time ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[experiments,sweep,docs,dev]'
	@touch $@

demo: setup
	$(BIN)/python -m experiments run pfc_elastic_6r --out $(DEMO_OUT)

# types are checked beside the tests, which all cores but one would wait for, and told at the end
test: lint
	@told=$$(mktemp); $(BIN)/mypy >$$told 2>&1 & types=$$!; \
	$(PYTEST) $(SELECTED); tests=$$?; \
	wait $$types; typed=$$?; cat $$told; rm -f $$told; \
	[ $$tests -eq 0 ] && [ $$typed -eq 0 ]

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/mypy

test-all:
	@$(MAKE) test PFSC_TESTS=all

unit: setup
	$(PYTEST) $(SELECTED)

# rounds with a seed each; memory is bounded, so that what devours it fails instead
fuzz: setup
	@end=$$(( $$(date +%s) + $(FUZZ_SECONDS) )); round=0; seed=$${SEED:-$$(date +%s)}; \
	ulimit -v 8000000 2>/dev/null || echo "memory cannot be bounded here"; \
	while [ $$(date +%s) -lt $$end ]; do \
		round=$$((round + 1)); \
		echo "round $$round, $$((end - $$(date +%s))) s left; again with: make fuzz SEED=$$seed"; \
		$(BIN)/python -m pytest -q -x -m fuzz --hypothesis-profile=fuzz \
			--hypothesis-seed=$$seed tests || exit 1; \
		seed=$$((seed + 1)); \
	done; echo "nothing found in $$round rounds"

benchmark: setup
	$(BIN)/python -m pytest tests/benchmarks --benchmark-enable --benchmark-columns=min,median,mean,max
	$(BIN)/python -m tests.benchmarks.paces

# warnings are errors; executed notebooks are kept beside what they wrote
docs: setup
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d out/doctrees docs out/site
	$(BIN)/python -m docs.making.site_links out/site
	@echo "Open out/site/index.html"

# the page of signals, metrics and figures
signals: setup
	$(BIN)/python -m reporting.registry > docs/reference/signals.md

# the picture of what imports what
architecture: setup
	$(BIN)/python -m docs.architecture

# every shipped scenario under every law that it has targets for; what was run at this revision is kept
results: setup
	$(BIN)/python -m docs.results

# pictures of recordings, drawn by a browser without a window
gallery: setup
	$(BIN)/python -m docs.pictures
	$(BIN)/python -m docs.pictures --film

models: setup
	$(BIN)/python -m pfsc_drake.robot.models.writer

clean:
	rm -rf $(VENV) out docs/tutorials/out .pytest_cache .mypy_cache .ruff_cache
