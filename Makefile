# `make study` and `make test` need git, make and Python 3.11, 3.12 or 3.13 only.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
RESULTS ?= results
CAMPAIGN ?= build/campaign
BIN := $(VENV)/bin
# One BLAS thread a process: the work is parallel elsewhere, and results must not depend on it.
export OPENBLAS_NUM_THREADS ?= 1
# Where it is set, every command that a test starts would compile the sources anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help env study test test-slow test-browser mutants campaign check lint types format paper bench docs clean

help:
	@echo "make study      run studies/linespeed.toml: results in $(RESULTS)/linespeed, summary, picture"
	@echo "make test       the tests (minutes)        make test-slow  the long ones too"
	@echo "make check      lint, types and tests: what CI runs"
	@echo "make paper      both studies of the paper, with their reports: $(RESULTS)/linespeed.html, traffic.html;"
	@echo "                renews the numbers of README, docs and studies from them"
	@echo "make test-browser  the report in a headless Chromium"
	@echo "make docs       the documentation as a site: build/site/index.html"
	@echo "make mutants    break guards one at a time: do the tests notice?"
	@echo "make campaign   1000 kills, 20 000 hostile studies (some 40 min); goes on where it stopped"
	@echo "make bench      realisations a second"
	@echo "make env        the environment only       make clean      forget everything built"

env: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	$(BIN)/mcsettle schema > studies/study.schema.json
	touch $@

# A study needs none of the tools of development.
$(VENV)/.runs: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

study: $(if $(wildcard $(VENV)/.installed),env,$(VENV)/.runs)
	$(BIN)/mcsettle run studies/linespeed.toml --out $(RESULTS)/linespeed
	$(BIN)/mcsettle summarise $(RESULTS)/linespeed --picture $(RESULTS)/linespeed.png

paper: study
	$(BIN)/mcsettle run studies/traffic.toml --out $(RESULTS)/traffic
	$(BIN)/mcsettle summarise $(RESULTS)/traffic --picture $(RESULTS)/traffic.png
	$(BIN)/mcsettle report $(RESULTS)/linespeed --markdown $(RESULTS)/linespeed.md
	$(BIN)/mcsettle report $(RESULTS)/traffic --markdown $(RESULTS)/traffic.md
	$(BIN)/mcsettle run studies/charges.toml --out $(RESULTS)/charges
	$(BIN)/mcsettle run studies/linespeed_uncertain.toml --out $(RESULTS)/linespeed_uncertain
	$(BIN)/mcsettle run studies/traffic_uncertain.toml --out $(RESULTS)/traffic_uncertain
	$(BIN)/python studies/paper_tables.py --factors $(RESULTS)/linespeed $(RESULTS)/traffic $(RESULTS)/charges \
	    $(RESULTS)/linespeed_uncertain $(RESULTS)/traffic_uncertain
	$(BIN)/python studies/gallery.py

# Two workers; a file's tests stay with one, since they share what its fixtures have run.
WORKERS ?= 2
SHARED := -n $(WORKERS) --dist loadfile

test: env
	$(BIN)/pytest $(SHARED) -m "not slow and not browser"

test-slow: env
	$(BIN)/pytest $(SHARED) -m "not browser"

# Says why and skips where there is no Chromium.
test-browser: env
	$(BIN)/pytest $(SHARED) -m browser -rs tests/browser

check: lint types test

lint: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: env
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The checker reads the tree as it is installed: kernels/ and cli/ inside the package.
types: env
	rm -rf build/types && mkdir -p build/types
	cp -r mcsettle build/types/mcsettle
	cp -r cli build/types/mcsettle/cli
	cp -r kernels build/types/mcsettle/kernels
	cd build/types && "$(abspath $(BIN))/mypy" --config-file ../../pyproject.toml -p mcsettle

# Guards broken one at a time: the tests have to notice each.
mutants: env
	$(BIN)/python tests/mutants.py

# Some 40 minutes of one core; goes on where it stopped. CAMPAIGN names the folder of its books.
campaign: env
	$(BIN)/python tests/campaign.py $(CAMPAIGN)

bench: env
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[bench,quadrants]"
	$(BIN)/python studies/benchmark.py
	$(BIN)/python studies/benchmark.py --both

# The site needs no package but those of the extra: it reads the sources.
docs: build/docs/.installed
	NO_MKDOCS_2_WARNING=1 build/docs/bin/mkdocs build --strict
	@echo "build/site/index.html; with search: python -m http.server -d build/site"

build/docs/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv build/docs
	build/docs/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt $$($(PYTHON) -c \
	    "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['docs'])")
	touch $@

clean:
	rm -rf build dist $(VENV) *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
