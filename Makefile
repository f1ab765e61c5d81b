# make demo    set up, build a fine grid of the Duran plate, solve it, draw its crack and the film of it
# make film    the same, for README.md and the pages
# make test    set up, run the quick tests
# make docs    the site, in site/
# make package   build wheel and source, install the wheel into an empty environment, use it there
# make pythons   the same with every Python from 3.12 to 3.14 that is found
# make check   lint, types, import contracts, limits of files and functions
# make slow    the verification that takes minutes
# make thesis  every scene of the thesis in both modes, on one page
# make sources the same, and a page for each of the other sources
# make failures  where methods fail, measured anew on one page
# make handbook  stress intensities of cracked plates beside the handbook's, measured anew on one page
# make bench    chart speed against accuracy: benchmarks/accuracy.json, rest.json and .png; check what plans promise
# make bench-speed  measure the solver on all plates: benchmarks/speed.json and .png
# make bench-quick  the same on one plate; fails where the fast kernel is too slow
# make compare AGAINST=DIR  solve all scenes here and with another checkout, and compare bit by bit
# make mutants  break the code on purpose, one place after the other, and see that tests notice
# make clean   remove what the others made

VENV ?= .venv
PYTHON ?= python3
BIN := $(VENV)/bin
SCENE := duran50

.PHONY: demo film test slow thesis sources failures handbook check bench bench-speed bench-quick compare mutants install \
	docs package pythons gmsh-libraries clean

# A thousand nodes across, fine where the crack runs: less than a minute of solving
demo: gmsh-libraries
	@mkdir -p demo
	$(BIN)/pdmesh build geometries/$(SCENE).geo --adapt hybrid --set Zones/fine/Spacing=1e-4 \
		--set Zones/coarse/Spacing=2e-4 --set "Loads/top/Traction y=18e6" --set "Loads/bottom/Traction y=-18e6" \
		--set Run/Duration=40e-6 -o demo/$(SCENE).json --force
	$(BIN)/pdsolve demo/$(SCENE).json --fields ux,uy,damage -o demo/$(SCENE).sqlite --force
	$(BIN)/pdpost damage demo/$(SCENE).sqlite -o demo/$(SCENE).png --force
	$(BIN)/pdpost animate demo/$(SCENE).sqlite --field stress --largest 5e7 --every 2 -o demo/$(SCENE).gif --force
	@echo "The picture of the crack: $(CURDIR)/demo/$(SCENE).png, its film: $(CURDIR)/demo/$(SCENE).gif"

film: demo
	cp demo/$(SCENE).gif docs/hybrid.gif
	cp demo/$(SCENE).png docs/duran50.png

test: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -m pytest -m "not slow"

slow: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -m pytest -m slow

thesis: $(VENV)/install.done gmsh-libraries
	$(BIN)/python -m benchmarks.thesis

sources: thesis
	$(BIN)/python -m benchmarks.sources

failures: $(VENV)/test.done
	$(BIN)/python -m pytest tests/stability --failures-page docs/where_methods_fail.md

handbook: $(VENV)/install.done
	$(BIN)/python -m benchmarks.handbook

check: $(VENV)/check.done
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python .ci/limits.py

docs: $(VENV)/docs.done
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "The site: $(CURDIR)/site/index.html"

package:
	.ci/package $(PYTHON)

PYTHONS := 3.12 3.13 3.14
pythons:
	@found=; for version in $(PYTHONS); do \
		for python in python$$version $$HOME/.pyenv/versions/$$version.*/bin/python; do \
			if "$$python" -c "" 2>/dev/null; then found="$$found $$python"; continue 2; fi; \
		done; \
		echo "Python $$version: not found, left out"; \
	done; \
	if [ -n "$$found" ]; then .ci/package $$found; else echo "found none of $(PYTHONS), expected one"; exit 2; fi

install: $(VENV)/install.done

$(VENV)/install.done: pyproject.toml
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11))" || \
		{ echo "$$($(PYTHON) --version) found, Python 3.11 or newer expected (make PYTHON=python3.11 ...)"; exit 2; }
	@$(PYTHON) -c "import ensurepip, venv" 2>/dev/null || \
		{ echo "Python's venv is missing; on Debian and Ubuntu: sudo apt-get install python3-venv"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

$(VENV)/%.done: $(VENV)/install.done
	$(BIN)/python -m pip install --quiet --group $*
	@touch $@

# Gmsh's wheel needs some libraries of the system: install them where that is possible, name them where not.
gmsh-libraries: $(VENV)/install.done
	@$(BIN)/python -c "import gmsh" 2>/dev/null || { \
		line="apt-get install -y --no-install-recommends $$($(BIN)/python -c 'from pdmesh.drawing.sandbox.child import SYSTEM_LIBRARIES; print(SYSTEM_LIBRARIES)')"; \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "Gmsh needs libraries of the system: $$line"; \
			apt-get update -qq && $$line; \
		else \
			echo "Gmsh needs libraries of the system; on Debian and Ubuntu: sudo $$line"; exit 2; \
		fi; }

bench: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -W ignore -m benchmarks.accuracy -o benchmarks/accuracy.json
	$(BIN)/python -W ignore -m benchmarks.planning --check
	$(BIN)/python -W ignore -m benchmarks.rest -o benchmarks/rest.json

bench-speed: gmsh-libraries
	$(BIN)/python -m benchmarks.speed -o benchmarks/speed.json $(if $(AGAINST),--against $(AGAINST))
	$(BIN)/python -W ignore -m benchmarks.laws -o benchmarks/laws.json
	$(BIN)/python -m benchmarks.savings

bench-quick: $(VENV)/install.done
	$(BIN)/python -m benchmarks.speed --quick

compare: $(VENV)/install.done gmsh-libraries
	$(BIN)/python -m benchmarks.compare $(AGAINST)

mutants: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -m benchmarks.mutants

clean:
	rm -rf $(VENV) demo build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find pdmesh pdsolve pdpost tests -name __pycache__ -prune -exec rm -rf {} +
