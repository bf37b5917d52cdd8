# make demo    a simulated clutch's life, posted run by run, with its prognosis      (ARGS=--exit to end by itself)
# make shell   a shell in which clutchlife is a command, and CLUTCHLIFE_URL is set
# make test    all tests but those of `make slow`
# make quick   those that need no browser and no server and take no time, in one process: 1,600 tests within a minute
# make slow    what takes long and rarely fails: what intervals promise, counted over many lives; further ways to the same
#              answer, files cut off anywhere                                                                   (30 minutes)
# make faults  kills the service and its commands hundreds of times, and sends what nobody sends: schemathesis over whole
#              sequences of requests, and files of every format with bytes changed, MINUTES=10 of each
#              (two and a half hours; ARGS="-k kills")
# make check   formatting, lint, types, layers; of the dashboard's JavaScript and styles too, for which it needs npm
# make lowest  tests that meet every dependency, on the oldest releases that pyproject.toml allows; wanted where those change
# make score   how good the prognosis is, on simulated lives: the tables of docs/appendix/prognosis.md  (SEED= SIZE= PARTS= ARGS=--write)
# make rivals  the same beside other packages, in an environment of their own                (SEED= SIZE=)
# make blind   hides effects and wants them found: the table of docs/appendix/diagnosis.md      (SEED= SIZE=small|full ONLY= ARGS=)
#              SUBSET=name: verdicts on a fixed set of campaigns, kept in .blind/name;
#              ARGS="--against other" puts two of them beside each other; ABLATE=each: every number that gates a verdict
#              taken for another (ABLATE=NUMBER=value: one)
# make law     diagnoses campaigns whose friction curve is not eq. 3 (measured curves of ../shared, eq. 3 with a share of their
#              misfit, other formulas): a table of docs/appendix/diagnosis.md; goes on where it ended with STORE=FILE
#              (SEED= SIZE=small|full ONLY= ARGS=--write)
# make law_adoption  adopts what the diagnosis offers of such campaigns and holds remaining life against the truth (the same)
# make files   a draw of files as rigs, loggers and spreadsheets write them: how many are read, suggested, asked for, or wrong: the
#              table of docs/appendix/benchmarks.md                                       (ARGS="--seed 63 --size 100 --each")
# make oracle  of campaigns in which the diagnosis fell short, how many one could name who knows the forms; reads what
#              `make blind` stored                                                         (the same SEED= SIZE= ONLY=)
# make visible hides effects at twice the amplitude that a report calls visible, and counts alarms (SEED= COUNT= STORE=)
# make adoption  hides artefacts, adopts what the diagnosis offers, holds remaining life against the truth: a table of
#              docs/appendix/diagnosis.md; goes on where it ended                         (SEED= SIZE=small|full ONLY= ARGS=--stored)
# make mutants  puts small faults into the product, each into a copy, and counts those that the tests of its folder find
#              (SEED= COUNT= ONLY= STORE=)
# make load     rigs and clients against a running service, what they wait and what is lost: a table of docs/appendix/benchmarks.md
#              (ARGS="--seconds 60 --no-raw"; "--slow 60"; "--services 4 --database postgresql --rigs 16 --clients 40 --no-raw"); a few
#              minutes, on a machine that does nothing else
# make scale    requests and commands with 1,000 clutches of 200 tests in one file, beside 10, and with a life of 1,000 tests,
#              beside 100: tables of docs/appendix/scale.md; fails where the long life costs more than is wanted
#              (ARGS="--clutches 10000 --states 5"); needs 7 GB of disk. python -m tests.lab.scale.replay --clutches 300: a replay
#              in one process, in a pool and on a Dask cluster of which a worker is killed
# make plausibility  sends mistyped and honest runs: the tables of docs/appendix/plausibility.md; STORE=FILE goes on where it
#              ended                                    (SEED= CAMPAIGNS= HONEST= LIVES= ABLATED= ARGS=--write)
# make real    what is said of real measurements; make benchmark: how long things take; make bench: as ratios to the least; make picture: README's pictures;
#              make figures: the figures of docs/
# make docs    the site of docs/, which the service serves at /help, with the pages on routes, fields, commands and codes made
#              from the code; warnings and dead links are errors
# make reference  all pages that are made from the code, those in git too
# make gallery    the figures of docs/gallery.md, drawn by the lines that stand beside them
# make architecture  the picture, the ways and the examples of docs/explanation/architecture.md, from the code
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
ARGS ?=
# minutes that `make faults` changes files of each format
MINUTES ?= 10
# the built site, as the service serves it and the wheel takes it along
HELP := service/dashboard/help
# what checks JavaScript: of `make check` alone, everything else needs Python only
JAVASCRIPT := tests/javascript/node_modules
# the pip of Python 3.11 reads the lists of packages with so many releases in more than twice the time
PIP := "pip>=25.1"

# what filterpy declares for its plots and no part of the product imports: 98 MB that stay out of every lock but that of the
# tests, which draw the gallery; which is why locked
# packages are installed with --no-deps
UNUSED := matplotlib contourpy cycler fonttools kiwisolver pillow
# versions age a week before they are locked; no index is named
LOCK := --universal --python-version 3.11 --generate-hashes --upgrade --quiet --exclude-newer "7 days" \
	--custom-compile-command "make lock"
SLIM := $(LOCK) $(foreach name,$(UNUSED),--no-emit-package $(name))

# what the first run of the tests compiles, the next ones read: a third of what `make quick` takes
unexport PYTHONDONTWRITEBYTECODE

.PHONY: files help compiled docs gallery reference adoption law_adoption demo shell test quick slow faults check check-python check-javascript lowest bench benchmark load scale real figures architecture blind law oracle visible mutants plausibility score rivals picture lock clean
.DELETE_ON_ERROR:

# the demo's pages link to /help: where it cannot be built, as without the internet, its page says so
demo: $(VENV)/.runs
	@test -f $(HELP)/index.html || $(MAKE) docs || echo "the documentation was not built: /help says how to build it" >&2
	$(BIN)/clutchlife demo $(ARGS)

shell: $(VENV)/.runs
	@echo "clutchlife is a command in this shell; exit leaves it"
	@PATH="$(abspath $(BIN)):$$PATH" VIRTUAL_ENV="$(abspath $(VENV))" CLUTCHLIFE_URL="$${CLUTCHLIFE_URL:-http://127.0.0.1:8000}" \
		$${SHELL:-/bin/sh} || true

# what each target is for, as it stands above
help:
	@sed -n '/^# make/,/^PYTHON/{s/^# \{0,1\}//p}' Makefile

# all that tests import is compiled, and their assertions rewritten, once: else each worker does so at the same time
compiled: $(VENV)/.tests
	@OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --collect-only -qq -m "not slow" > /dev/null

test: $(VENV)/.tests
	$(BIN)/python -m tests.browser
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow" $(ARGS)

quick: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -m "not slow and not outside and not long" $(ARGS)

slow: $(VENV)/.tests $(VENV)-generator/.ready
	$(BIN)/python -m tests.browser
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m slow $(ARGS)

faults: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 CLUTCHLIFE_FUZZ_MINUTES=$(MINUTES) $(BIN)/python -m pytest -m slow tests/journeys/faults tests/journeys/test_openapi.py \
		tests/service/readers $(ARGS)

check: check-python check-javascript

check-python: $(VENV)/.tests
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

check-javascript: $(VENV)/.tests $(JAVASCRIPT)/.package-lock.json
	$(JAVASCRIPT)/.bin/prettier --config tests/javascript/prettier.json --check "service/dashboard/static/**/*.{js,css,ts}" "tests/javascript/*.json"
	$(BIN)/python -m tests.javascript.types
	$(JAVASCRIPT)/.bin/tsc --project tests/javascript

# what the oldest releases deprecate among themselves is theirs; our own tests stay strict in `test`. Every dependency is met:
# storage, files, numerics, the service over a socket.
lowest: $(VENV)-lowest/.tests
	OPENBLAS_NUM_THREADS=1 $(VENV)-lowest/bin/python -m pytest -n 2 -m "not slow" -W default::DeprecationWarning tests/storage tests/service/runs/test_upload.py \
		tests/service/readers tests/models/friction/test_identification.py \
		tests/models/tracking/filters tests/models/diagnosis/test_extension.py tests/journeys/test_contract.py $(ARGS)
	sha256sum tests/requirements-lowest.txt > tests/lowest.tried

picture: $(VENV)/.tests
	$(BIN)/python -m tests.lab.pictures

benchmark: $(VENV)/.tests
	$(BIN)/python -m tests.lab.benchmarks $(ARGS)

files: $(VENV)/.tests
	$(BIN)/python -W ignore -m tests.lab.files $(ARGS)

bench: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.benchmarks.ratios $(ARGS)

load: $(VENV)/.tests
	$(BIN)/python -m tests.lab.load $(ARGS)

scale: $(VENV)/.tests
	$(BIN)/python -m tests.lab.scale $(ARGS)
	$(BIN)/python -m tests.lab.scale.long_life

real: $(VENV)/.tests
	$(BIN)/python -m tests.lab.real $(ARGS)

figures: $(VENV)/.tests
	$(BIN)/python -m tests.lab.figures

docs: $(VENV)-docs/.ready $(VENV)/.runs
	$(BIN)/python -m tests.documents made
	rm -rf $(HELP)
	$(VENV)-docs/bin/python -m sphinx --quiet --fail-on-warning --keep-going --builder html --fresh-env \
		--doctree-dir $(VENV)-docs/doctrees docs $(HELP)
	@echo "the site is in $(HELP); a service that is started now shows it at /help"

reference: $(VENV)/.tests
	$(BIN)/python -m tests.documents

gallery: $(VENV)/.tests
	PYTHONPATH=service/client $(BIN)/python -m tests.documents.gallery

architecture: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.architecture

law: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.law $(ARGS)

law_adoption: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.law.adoption $(ARGS)

blind: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.blind$(if $(ABLATE),.ablations,$(if $(SUBSET),.subset)) $(ARGS)

oracle: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.blind.oracle $(ARGS)

visible: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.visible

mutants: $(VENV)/.tests
	$(BIN)/python -m tests.lab.mutants

adoption: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.adoption $(ARGS)

plausibility: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.plausibility $(ARGS)

score: $(VENV)/.tests
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.lab.score $(ARGS)

rivals: $(VENV)-rivals/.ready
	OPENBLAS_NUM_THREADS=1 $(VENV)-rivals/bin/python -m tests.lab.rivals.laws $(ARGS)
	OPENBLAS_NUM_THREADS=1 $(VENV)-rivals/bin/python -m tests.lab.rivals $(ARGS)

$(VENV)-rivals/.ready: pyproject.toml | $(VENV)/.python
	$(PYTHON) -m venv $(VENV)-rivals
	$(VENV)-rivals/bin/python -m pip install --quiet --disable-pip-version-check $(PIP)
	$(VENV)-rivals/bin/python -m pip install --quiet --disable-pip-version-check --group rivals --editable .
	@touch $@

$(VENV)/.python:
	@command -v $(PYTHON) >/dev/null || { echo "Clutchlife needs Python 3.11 or later; '$(PYTHON)' is not there. Name another: make PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Clutchlife needs Python 3.11 or later, '$(PYTHON)' is $$($(PYTHON) --version). Name another: make PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' || { echo "'$(PYTHON)' cannot make virtual environments; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check $(PIP)
	@touch $@

$(VENV)-lowest/.tests: pyproject.toml tests/requirements-lowest.txt | $(VENV)/.python
	$(PYTHON) -m venv $(VENV)-lowest
	$(VENV)-lowest/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r tests/requirements-lowest.txt
	$(VENV)-lowest/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@touch $@

$(VENV)/.runs: $(VENV)/.python pyproject.toml docker/requirements.txt
	@echo "Installing the $$(grep -c == docker/requirements.txt) packages that Clutchlife needs into $(VENV): once, a minute or two"
	@$(BIN)/python -m pip install --disable-pip-version-check --no-deps --require-hashes -r docker/requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@touch $@

$(VENV)/.tests: $(VENV)/.runs tests/requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r tests/requirements.txt
	@touch $@

$(VENV)-generator/.ready: tests/requirements-generator.txt | $(VENV)/.python
	$(PYTHON) -m venv $(VENV)-generator
	$(VENV)-generator/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r tests/requirements-generator.txt
	@touch $@

$(VENV)-docs/.ready: docs/requirements.txt | $(VENV)/.python
	$(PYTHON) -m venv $(VENV)-docs
	$(VENV)-docs/bin/python -m pip install --quiet --disable-pip-version-check $(PIP)
	$(VENV)-docs/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r docs/requirements.txt
	@touch $@

$(JAVASCRIPT)/.package-lock.json: tests/javascript/package.json tests/javascript/package-lock.json
	@command -v npm >/dev/null || { echo "make check needs npm (with Node.js 20 or later) for the dashboard's JavaScript; 'npm' is not there. make test and make demo do without it." >&2; exit 1; }
	cd tests/javascript && npm ci --ignore-scripts --loglevel=error
	@touch $@

lock:
	uv pip compile $(SLIM) pyproject.toml -o docker/requirements.txt
	uv pip compile $(SLIM) pyproject.toml --extra cluster --extra objects --extra postgresql -o docker/requirements-scale.txt
	uv pip compile $(LOCK) pyproject.toml --group test -o tests/requirements.txt
	uv pip compile $(SLIM) --group docs -o docs/requirements.txt
	uv pip compile $(SLIM) --group generator -o tests/requirements-generator.txt
	uv pip compile $(SLIM) --resolution lowest-direct pyproject.toml --group test -o tests/requirements-lowest.txt

clean:
	rm -rf $(JAVASCRIPT) $(VENV) $(VENV)-lowest $(VENV)-generator $(VENV)-rivals $(VENV)-docs $(HELP) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
