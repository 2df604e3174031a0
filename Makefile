# Every target works alone on a fresh checkout: what it needs is installed in .venv first.
#   make test PYTHON=/path/to/python    another interpreter for a new .venv (3.11 or newer)
#   make test ARGS="-k wheel"           more arguments for pytest
VENV := .venv
PY := $(VENV)/bin/python
PIP := $(PY) -m pip --quiet --no-input --disable-pip-version-check
# A file's tests stay in one process, which compiles what they share once; the files go to every core, the dear ones of
# tests/physics first.
# A worker that dies fails the run: xdist would start another, and then wait for ever for the file that died with it.
PYTEST := $(PY) -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder --max-worker-restart 0
# Lint fills the core that is idle while tests begin and end; what it says comes last, in one piece.
BESIDE_LINT = log=$$(mktemp); $(MAKE) --no-print-directory lint >$$log 2>&1 & lint=$$!; \
	trap "kill $$lint 2>/dev/null; rm -f $$log" EXIT; \
	$(1); status=$$?; wait $$lint || status=$$?; cat $$log; exit $$status
ARGS ?=
# Records that `make fits` makes: never the shipped ones, which tests and pages read.
MADE := build/fits
# Pages with tables of what was fitted, between marks.
TABLES := README.md docs/explanation/models.md docs/validation/paper.md docs/explanation/layers.md docs/explanation/phases.md docs/validation/checks.md

.DEFAULT_GOAL := help
.PHONY: help fits records evidence claims docs test test-all benchmark programs lint format wheel clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*  ## /\1\t/p' $(MAKEFILE_LIST) | while read -r name text; do printf '%-10s%s\n' "$$name" "$$text"; done

fits: $(VENV)/.installed  ## make every record again in build/fits, compare it with the shipped one, and write the report
	@$(VENV)/bin/profilefit regenerate --out $(MADE); status=$$?; \
	$(VENV)/bin/profilefit report --fits $(MADE) --figures $(MADE)/figures >$(MADE)/report.txt \
	&& echo "report: $(MADE)/report.txt, figures beside it" && exit $$status

records: $(VENV)/.installed-test  ## for maintainers: write the records into fits/, the tables of pages, and the pins of tests
	$(VENV)/bin/profilefit regenerate --out fits
	$(VENV)/bin/profilefit report --fits fits --figures fits/figures
	for page in $(TABLES); do $(VENV)/bin/profilefit report --fits fits --markdown $$page || exit; done
	$(PY) -m tests.unit.test_pins

evidence: $(VENV)/.installed programs  ## measure what reports show beside the fits, on an idle machine: shader check, atlas, times; fifteen minutes
	$(VENV)/bin/profilefit check --fits fits --out fits/evidence
	$(VENV)/bin/profilefit stability --fits fits --out fits/evidence
	$(VENV)/bin/profilefit tradeoff --fits fits --out fits/evidence

claims: $(VENV)/.installed-test programs  ## measure what README and guides promise, on an idle machine: two hours; ARGS=--quick: less, noisier
	@$(PIP) install --editable '.[benchmark]'
	$(PY) -m benchmarks.claims $(ARGS)
	$(VENV)/bin/profilefit report --fits fits --markdown docs/validation/claims.md

test: $(VENV)/.installed-test programs  ## what CI runs: lint, and all tests but the slow ones
	@$(call BESIDE_LINT,$(PYTEST) -m "not slow" $(ARGS))

# Five times the CPU seconds of the slowest file on a Zen 4 core: a slower machine is no failure.
test-all: $(VENV)/.installed-test programs  ## lint, and all tests; a file whose quick tests take over 80 CPU seconds fails
	@$(call BESIDE_LINT,$(PYTEST) --budget 80 $(ARGS))

benchmark: $(VENV)/.installed-test  ## speed and accuracy of the tracer, over scalar tracers, in one run
	@$(PIP) install --editable '.[benchmark]'
	$(PY) benchmarks/tracer.py $(ARGS)

docs: $(VENV)/.installed-test  ## build the site into docs/_build/html; a warning is an error
	$(PY) -m sphinx --fail-on-warning --keep-going --builder html docs docs/_build/html

programs: $(VENV)/.installed  ## OpenGL, an HLSL compiler, a browser, as root on Debian; elsewhere tests of them are skipped
	@sh -c "$$FIND_PROGRAMS"

lint: $(VENV)/.installed-test  ## ruff, codespell and mypy; changes nothing
	$(PY) -m ruff check
	$(PY) -m ruff format --check
	$(PY) -m codespell_lib
	$(PY) -m mypy

format: $(VENV)/.installed-test  ## let ruff fix and format the sources
	$(PY) -m ruff check --fix
	$(PY) -m ruff format

wheel: $(VENV)/.installed-test  ## build the sdist, and from it the wheel, into dist/
	$(PY) -m build

clean:  ## remove build products and caches; .venv and fits/ stay
	rm -rf dist build docs/_build docs/laws .pytest_cache .mypy_cache .ruff_cache
	find . -path ./$(VENV) -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +

# A stamp is as new as the last installation from pyproject.toml. The second waits for the first, so `make -j` is safe.
$(VENV)/.installed: pyproject.toml
	@sh -c "$$CREATE_VENV"
	@echo "installing profilefit and what it needs into $(VENV)"
	@$(PIP) install --editable .
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	@echo "installing what the tests need into $(VENV)"
	@$(PIP) install --editable '.[test]'
	@touch $@

# Keeps a .venv that works. Debian splits ensurepip, which a new one needs, from python3 into a package of its own.
define CREATE_VENV
set -eu
if $(PY) -m pip --version >/dev/null 2>&1; then exit 0; fi
python=
for candidate in $(or $(PYTHON),python3.11 python3 python3.14 python3.13 python3.12); do
    if "$$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
        python=$$candidate
        break
    fi
done
if [ -z "$$python" ]; then
    echo "found no Python 3.11 or newer: install one, or name it with make PYTHON=/path/to/python" >&2
    exit 1
fi
if ! "$$python" -c 'import ensurepip, venv' 2>/dev/null; then
    package=$$("$$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
    if [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
        echo "$$python cannot make a virtual environment: install $$package (apt-get install $$package, as root)" >&2
        exit 1
    fi
    echo "installing $$package with apt-get: $$python cannot make a virtual environment without it"
    apt-get -qq update
    DEBIAN_FRONTEND=noninteractive apt-get -qq -y --no-install-recommends install "$$package" >/dev/null
fi
echo "creating $(VENV) with $$python"
"$$python" -m venv --clear $(VENV)
endef
export CREATE_VENV

# What tests need beside Python; without it they are skipped by name: libEGL with a rasteriser behind it, a compiler of HLSL,
# a browser.
define FIND_PROGRAMS
set -eu
packages=
if ! $(PY) -c 'import moderngl; moderngl.create_context(standalone=True, backend="egl", require=330)' >/dev/null 2>&1; then
    packages=" libegl1 libgl1 libgl1-mesa-dri"
fi
if ! command -v glslangValidator >/dev/null; then packages="$$packages glslang-tools"; fi
if ! command -v chromium >/dev/null && ! command -v google-chrome >/dev/null; then packages="$$packages chromium"; fi
if [ -z "$$packages" ]; then exit 0; fi
if [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
    echo "tests of the shader and of reports will be skipped where they need what is missing (Debian:$$packages)" >&2
    exit 0
fi
echo "installing with apt-get, for the tests of the shader and of reports:$$packages"
export DEBIAN_FRONTEND=noninteractive
if ! { apt-get -qq update && apt-get -qq -y --no-install-recommends install $$packages >/dev/null; }; then
    echo "apt-get failed: tests will be skipped where they need what is missing" >&2
fi
endef
export FIND_PROGRAMS
