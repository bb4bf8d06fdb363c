# Two commands: `make demo` fits the bundled scan, `make test` runs the tests. Each makes .venv and installs what is pinned
# when that has not been done, and compiles what fits need, so they work in any order and on a fresh clone.

# The first Python of a supported version; `make demo PYTHON=/path/to/python3.12` names another.
PYTHON ?= $(shell for p in python3 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.kpred-installed
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input -qq
TORCH := torch==2.13.0
LINTED := src tests scripts examples benchmarks integrations

.PHONY: demo test lint format install docs dist wheel-test blender clean
.DELETE_ON_ERROR:

demo: $(STAMP)
	@$(BIN)/kpred demo

test: $(STAMP)
	@$(BIN)/python -m pytest -n 2 --dist loadfile -q

lint: $(STAMP)
	@$(BIN)/ruff check $(LINTED)
	@$(BIN)/ruff format --check $(LINTED)
	@$(BIN)/mypy
	@$(BIN)/lint-imports

format: $(STAMP)
	@$(BIN)/ruff check --fix $(LINTED)
	@$(BIN)/ruff format $(LINTED)

install: $(STAMP)

# The site, into build/site; a broken link is an error.
docs: $(STAMP)
	@test -x $(BIN)/mkdocs || $(PIP) install -c constraints.txt -e '.[docs]'
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# Source archive, the wheel made of it, and the wheel of the paper's weights, into dist/.
dist: $(STAMP)
	@$(BIN)/python -m build --version >/dev/null 2>&1 || $(PIP) install -c constraints.txt build
	@rm -rf dist
	@PIP_CONSTRAINT=constraints.txt $(BIN)/python -m build --outdir dist >build.log 2>&1 || { cat build.log >&2; exit 1; }
	@PIP_CONSTRAINT=constraints.txt $(BIN)/python -m build --wheel --outdir dist paper >build.log 2>&1 || { cat build.log >&2; exit 1; }
	@rm -f build.log

# The wheel as a user has it: an environment of its own, an empty folder, an empty home.
wheel-test: dist
	@scripts/test_wheel.sh $(BIN)/python '$(TORCH)'

# The Blender add-on as an extension, into dist/.
blender: $(STAMP)
	@$(BIN)/python scripts/make_blender_addon.py

# torch goes first and alone: everything after it then finds the pinned build in place.
$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "kpred needs Python 3.11 or 3.12: install one, or name it: make PYTHON=/path/to/python3.12" >&2; exit 1; }
	@test -x $(BIN)/python || { echo "making $(VENV)"; $(PYTHON) -m venv $(VENV); }
	@echo "installing $(TORCH) (a large download the first time)"
	@$(PIP) install -c constraints.txt '$(TORCH)'
	@echo "installing kpred and its pinned dependencies"
	@$(PIP) install -c constraints.txt -e '.[dev]' $(addprefix -e ./,$(wildcard paper))
	@$(BIN)/kpred compile
	@touch $(STAMP)

clean:
	rm -rf $(VENV) build dist kpred-demo .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +
