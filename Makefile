# make demo: set up, then the whole chain on a CPU, ending in an HTML report.
# make test: set up, then lint, types and tests. make bench: the measurements of bench/
# that need no input of yours.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
TEST_READY := $(VENV)/.test-ready
BENCH_WITH_INPUT := bench/altered_photographs.py bench/altered_pictures.py bench/conditioning.py bench/cycles.py \
	bench/error_bands.py bench/error_colours.py bench/raw_octaves.py bench/what_if.py

.PHONY: demo test bench setup clean

demo: setup
	$(BIN)/fsid demo -o fsid-demo

test: $(TEST_READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/pytest

bench: $(TEST_READY)
	for script in $(filter-out $(BENCH_WITH_INPUT),$(wildcard bench/*.py)); do echo "== $$script"; $(BIN)/python $$script || exit 1; done

setup: $(READY)

$(READY): pyproject.toml constraints.txt tools/system-libraries.sh
	! command -v $(PYTHON) >/dev/null || $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "FSID needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	PYTHON=$(PYTHON) tools/system-libraries.sh
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[train]'
	touch $(READY)

$(TEST_READY): $(READY)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[all,test]'
	touch $(TEST_READY)

clean:
	rm -rf $(VENV) build dist fsid-demo test-output .pytest_cache .mypy_cache .ruff_cache
