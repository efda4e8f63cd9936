# Two commands matter: `make demo` and `make test`. Both set everything up first, and need the network only then.
# Every path is relative, so that a folder with spaces in its name works.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python
READY := $(VENV)/.ready
# One thread for linear algebra: timings are comparable, and two processes do not fight for two cores.
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1

.PHONY: demo test fuzz lint fmus identify-fmus region-fmus lock clean

demo: $(READY)
	$(RUN) -m cosimulation demo

test: $(READY)
	$(RUN) -m pytest

# The long run of docs/fuzzing.md: make fuzz SECONDS=600
SECONDS ?= 600
fuzz: $(READY)
	PYTHONPATH=tests $(RUN) -m fuzz.long --seconds $(SECONDS)

lint: $(READY)
	$(RUN) -m ruff format .
	$(RUN) -m ruff check --fix .
	$(RUN) -m mypy

# The FMUs in the folders of fmus/, from the parameters that stand there; the same bytes for the same sources.
fmus: $(READY)
	$(RUN) -m fmus

# Identifies the networks of fmus/ anew, which takes minutes, shows how far their FIT is from the committed one, and
# proves their stability anew.
# `llmn study shipped` shows the same and replaces nothing.
identify-fmus: $(READY)
	$(RUN) -m fmus wbm
	rm -rf runs/study-shipped
	-$(RUN) -m cosimulation study shipped
	cp -R runs/study-shipped/models/. fmus/
	for name in surrogate n4sid surrogate_blow n4sid_blow; do \
		$(RUN) -m cosimulation prove fmus/$$name/parameters.json --rate 6 --store || exit 1; \
	done
	$(RUN) -m fmus

# Stores in the networks of fmus/ where they were trained, worked out from their data made anew; nothing else changes.
region-fmus: $(READY)
	rm -rf runs/region
	for set in A Blow; do \
		$(RUN) -m cosimulation generate cosimulation/studies/demo.toml --reference fmus/wbm/pantograph_wbm.fmu \
			--start preset=$$set --output runs/region/$$set || exit 1; \
	done
	for name in surrogate n4sid; do \
		$(RUN) -m cosimulation region fmus/$$name/parameters.json --data runs/region/A --store || exit 1; \
		$(RUN) -m cosimulation region fmus/$${name}_blow/parameters.json --data runs/region/Blow --store || exit 1; \
	done
	$(RUN) -m fmus

$(READY): requirements.txt pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed (make PYTHON=...); this is " + sys.version.split()[0])'
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.txt
	$(RUN) -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --no-index -e .
	touch $(READY)

# Needs the network: writes the pins anew from the ranges in pyproject.toml.
lock: $(READY)
	$(RUN) -m pip install --quiet uv
	$(RUN) -m uv pip compile pyproject.toml --extra test --extra build --universal --python-version 3.11 \
		--generate-hashes --no-header --no-annotate --no-emit-index-url --output-file requirements.txt

clean:
	rm -rf $(VENV) runs .pytest_cache .mypy_cache .ruff_cache
