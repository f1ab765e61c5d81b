# make demo    set up, a first picture; then a glass plate a thousand nodes across, fine near its crack alone, and its film
# make test    set up, run the quick tests
# make docs    build the site below site/, from docs (VERSION=1.1.0: below site/1.1.0, with a choice of versions)
# make package   build wheel and source, install the wheel into an empty environment, use it there
# make pythons   the same with every Python from 3.11 to 3.14 that is found
# make check   lint, types, import contracts, limits of files and functions
# make slow    the verification that takes minutes (TURN=1/16: a sixteenth of it)
# make breadth  more cases of what the quick tests sample (TURN likewise)
# make optional  the tests of packages that users may leave out, and whether devices can be tested here
# make thesis  every scene of the thesis in both modes, on one page
# make sources the same, and a page for each of the other sources
# make failures  where methods fail, measured anew on one page
# make handbook  stress intensities of cracked plates beside the handbook's, measured anew on one page
# make materials  what can be combined, settings of materials, what bodies do not have: tables of pages
# make forks   where a crack of particles forks, over time steps and grids: a table
# make split   what cells that split cost against threshold and interval: docs/verification/split.png and a table
# make wheels   which systems and Pythons have wheels of all requirements: a table
# make bench    check what plans promise: benchmarks/planning.json
# make bench-speed  measure the solver on all plates: benchmarks/speed.json and .png
# make bench-quick  the same on one plate; fails where the fast kernel is too slow
# make compare AGAINST=DIR  solve all scenes here and with another checkout, and compare bit by bit
# make mutants  break the code on purpose, in places written down, and see that tests notice
# make places   tests of files, users, locks, processes, walls and caches where the host has no name, as another user, without HOME and so on (PLACES="spaced wheel")
# make size    lines of the packages, and through how many files a model goes until its first step
# make endurance  hundreds of forgeries; then kills, corruptions, full disks and more, in at most an hour: docs/developers/endurance.md
# make clean   remove what the others made

VENV ?= .venv
PYTHON ?= python3
BIN := $(VENV)/bin
TWO := -n 2 --dist worksteal # tests in two processes
unexport PYTHONDONTWRITEBYTECODE # tests start hundreds of processes, each of which would compile all it imports

.PHONY: demo test slow breadth optional thesis sources failures handbook materials forks docs split check bench bench-speed bench-quick compare \
	mutants size places endurance wheels install package pythons gmsh-libraries clean

# The first picture is of a plate without adaptivity: its kernels are compiled in a fifth of the time of hybrid's, which
# a short run compiles meanwhile on another core
DEMO := geometries/duran50.geo --set "Loads/top/Traction y=18e6" --set "Loads/bottom/Traction y=-18e6" --quiet --force
WAIT = $(BIN)/python .ci/waiting.py
demo: gmsh-libraries
	@mkdir -p demo && rm -f demo/warm.done
	@$(WAIT) "1/6 reading the drawing of a glass plate" $(BIN)/pdmesh build $(DEMO) \
		--set Zones/fine/Spacing=1e-3 --set Zones/coarse/Spacing=1e-3 -o demo/first.json
	@echo "2/6 solving with nodes 1 mm apart; kernels are compiled for this processor, once"
	@{ $(BIN)/pdsolve demo/first.json --adapt hybrid --set run.steps=20 -o demo/warm.sqlite --quiet --force; \
		touch demo/warm.done; } & \
		$(BIN)/pdsolve demo/first.json -o demo/first.sqlite --force && \
		$(WAIT) "3/6 drawing the damage" $(BIN)/pdpost damage demo/first.sqlite -o demo/first.png --quiet --force && \
		echo "The first picture: $(CURDIR)/demo/first.png" && \
		$(WAIT) "4/6 laying nodes 0.2 mm apart, and 0.1 mm near the crack" $(BIN)/pdmesh build $(DEMO) --adapt hybrid \
			--set Zones/fine/Spacing=1e-4 --set Zones/coarse/Spacing=2e-4 -o demo/fork.json && \
		$(WAIT) "5/6 waiting for the kernels of fine zones" sh -c "until [ -e demo/warm.done ]; do sleep 0.2; done"
	@$(BIN)/pdsolve demo/fork.json -o demo/fork.sqlite --force
	@$(WAIT) "6/6 drawing the damage" $(BIN)/pdpost damage demo/fork.sqlite -o demo/fork.png --quiet --force
	@$(BIN)/pdpost animate demo/fork.sqlite --field stress --largest 5e7 -o demo/fork.gif --force
	@echo "Three pictures of one plate under one load, in $(CURDIR)/demo:"
	@echo "  first.png  damage, nodes 1 mm apart. Bonds are up to 4 mm long, and nodes so near to a crack lose some"
	@echo "  fork.png   damage, nodes 0.1 mm apart near the crack and bonds up to 0.4 mm long there: a narrower crack."
	@echo "             Where it branches, and how often, depends on stress waves that the coarser grid does not have"
	@echo "  fork.gif   the run of fork.png over time, but the stress in place of the damage: waves leave the tips"

test: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -m pytest $(TWO) -m "not slow and not endurance"

TURN := 0/1
slow: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -m pytest $(TWO) --turn $(TURN) -m "slow and not breadth and not endurance"

breadth: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -m pytest $(TWO) --turn $(TURN) -m "breadth and not endurance"

optional: $(VENV)/test.done $(VENV)/optional.done gmsh-libraries
	PYTHONPATH=.ci $(BIN)/python -m pytest $(TWO) -p optional

thesis: $(VENV)/install.done gmsh-libraries
	$(BIN)/python -m benchmarks.thesis

sources: thesis
	$(BIN)/python -m benchmarks.sources

failures: $(VENV)/test.done
	$(BIN)/python -m pytest tests/stability --failures-page docs/verification/limitations.md

handbook: $(VENV)/install.done
	$(BIN)/python -m benchmarks.handbook

materials: $(VENV)/install.done
	$(BIN)/python -m benchmarks.combinations

forks: $(VENV)/install.done
	$(BIN)/python -m benchmarks.forks

VERSION :=
# -E: pages that Sphinx does not read anew lose their words in the index of the search
docs: $(VENV)/docs.done gmsh-libraries
	$(BIN)/sphinx-build -E -W --keep-going -q $(if $(VERSION),-t versioned) docs site/$(VERSION)
	@$(if $(VERSION),$(BIN)/python .ci/versions.py site)
	@echo "The site: $(CURDIR)/site/index.html"

split: $(VENV)/install.done
	$(BIN)/python -m benchmarks.split

check: $(VENV)/check.done
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python .ci/limits.py

package:
	.ci/package $(PYTHON)

PYTHONS := 3.11 3.12 3.13 3.14
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
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "pip>=25.1" "uv>=0.5" || \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check "pip>=25.1"
	$(call install,--editable .)
	@touch $@

$(VENV)/%.done: $(VENV)/install.done
	$(call install,--group $*)
	@touch $@

# uv installs in a fifth of pip's time; pip stands in where uv is missing or does not know the index that pip is told of
install = { $(BIN)/python -m uv pip install --quiet --python $(BIN)/python $(1) 2>$(VENV)/uv.log || \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check $(1); }

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

wheels: $(VENV)/install.done
	$(BIN)/python .ci/wheels.py

bench: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -W ignore -m benchmarks.planning --check

bench-speed: gmsh-libraries
	$(BIN)/python -m benchmarks.speed -o benchmarks/speed.json $(if $(AGAINST),--against $(AGAINST))

bench-quick: $(VENV)/install.done
	$(BIN)/python -m benchmarks.speed --quick

compare: $(VENV)/install.done gmsh-libraries
	$(BIN)/python -m benchmarks.compare $(AGAINST)

size: $(VENV)/install.done gmsh-libraries
	$(BIN)/python -m benchmarks.size

mutants: $(VENV)/test.done gmsh-libraries
	PYTHONPATH=tests $(BIN)/python -m mutants

PLACES := all
places: $(VENV)/test.done gmsh-libraries
	VENV=$(VENV) .ci/places $(PLACES)

MINUTES := 55
endurance: $(VENV)/test.done gmsh-libraries
	$(BIN)/python -m pytest $(TWO) -m endurance --hypothesis-profile=random
	$(BIN)/python -m benchmarks.endurance --minutes $(MINUTES)

clean:
	rm -rf $(VENV) demo build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find pdmesh pdsolve pdpost tests -name __pycache__ -prune -exec rm -rf {} +
