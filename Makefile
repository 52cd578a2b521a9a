# Everything runs in its own virtual environment, with pinned versions; nothing needs activating.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# One BLAS thread a process: the runner and the tests are parallel already.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help bench bench-quick report speed test test-slow lint docs own-data pictures realism accuracy panoramas reproduce constraints clean

help:
	@echo "make bench        set up, then compare sensors and estimators in the simulated laboratory (about a minute)"
	@echo "make bench-quick  the same with one seed and fewer steps"
	@echo "make report       run the whole benchmark, and write docs/reports and the README's table (half an hour or more; goes on where it stopped)"
	@echo "make speed        set up with the peers, then time our steps beside theirs (some minutes)"
	@echo "make test         set up, then run the tests"
	@echo "make test-slow    the tests that take longer"
	@echo "make lint         ruff, mypy and the import contract"
	@echo "make docs         build the documentation with warnings as errors, into docs/_build"
	@echo "make pictures     draw the pictures of the README and of docs/worlds.md again"
	@echo "make realism      measure how hard the laboratory is, and write the table of docs/worlds.md (some minutes)"
	@echo "make accuracy     measure how often each estimator is right, and write the tables of docs/estimators.md (minutes)"
	@echo "make panoramas    measure how well panoramas close, and write the table of docs/panoramas.md (minutes)"
	@echo "make own-data     measure the tables of docs/maps.md, import.md and check.md again (minutes)"
	@echo "make reproduce    do all published experiments again, and write their two pages (about two hours)"
	@echo "make constraints  write constraints.txt anew from the newest versions"

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(v < (3, 11) and "topoloc needs Python 3.11 or newer, this is %d.%d; try: make PYTHON=python3.11 ..." % v)'
	@echo "setting up $(VENV) (once; a minute or two)"
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) install -c constraints.txt -e ".[ros,dds]"
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	@$(PIP) install -c constraints.txt -e ".[dev]"
	@touch $@

bench: $(VENV)/.installed
	@$(BIN)/topoloc bench

bench-quick: $(VENV)/.installed
	@$(BIN)/topoloc bench --quick

report: $(VENV)/.installed
	@$(BIN)/topoloc bench $$(test -f runs/report/config.toml && echo --resume runs/report || echo --full --out runs/report)
	@$(BIN)/python -m benchmarks.publish runs/report

# particles asks for numpy below 2, and works with 2: hence without its dependencies.
$(VENV)/.installed-speed: $(VENV)/.installed
	@$(PIP) install -c constraints.txt -e ".[speed]"
	@$(PIP) install --no-deps particles==0.4
	@touch $@

speed: $(VENV)/.installed-speed
	@$(BIN)/topoloc speed

test: $(VENV)/.installed-dev
	@$(BIN)/python -m pytest -n auto -m "not slow"

test-slow: $(VENV)/.installed-dev
	@$(BIN)/python -m pytest -n auto -m slow

lint: $(VENV)/.installed-dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@MYPYPATH=tests $(BIN)/mypy --explicit-package-bases tests
	@$(BIN)/lint-imports

docs: $(VENV)/.installed-dev
	@$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build

pictures: $(VENV)/.installed
	@$(BIN)/python -m benchmarks.pictures
	@$(BIN)/python -m benchmarks.world_pictures

realism: $(VENV)/.installed
	@$(BIN)/python -m benchmarks.realism --write

accuracy: $(VENV)/.installed
	@$(BIN)/python -m benchmarks.accuracy --write

panoramas: $(VENV)/.installed
	@$(BIN)/python -m benchmarks.panoramas --write

own-data: $(VENV)/.installed
	@$(BIN)/python -m benchmarks.own_data --write

reproduce: $(VENV)/.installed
	@$(BIN)/topoloc reproduce all $$(test -d runs/reproduce-all && echo --resume || echo --out) runs/reproduce-all
	@$(BIN)/python -m benchmarks.experiments.document runs/reproduce-all

constraints:
	@rm -rf $(VENV)-newest && $(PYTHON) -m venv $(VENV)-newest
	@$(VENV)-newest/bin/python -m pip --quiet install -e ".[dev,speed,ros,dds,docs]"
	@( echo "# Names and versions that the project is tested with; 'make constraints' writes this."; \
	   $(VENV)-newest/bin/python -m pip freeze --exclude-editable ) > constraints.txt
	@rm -rf $(VENV)-newest

clean:
	@rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis runs docs/_build
