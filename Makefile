# `make demo` runs the main jobs, `make test` passes the tests; both set themselves up in .venv.
PYTHON := .venv/bin/python
PYTEST := $(PYTHON) -m pytest -n 2 --dist worksteal --durations=15 --durations-min=1 --ignore=tests/browser
.DEFAULT_GOAL := demo
help: ## this list
	@sed -nE 's/^([a-z-]+):.*## (.*)/\1|\2/p' $(MAKEFILE_LIST) | sort | awk -F'|' '{printf "  make %-16s %s\n", $$1, $$2}'

.PHONY: help demo test bytecode test-long drives test-pages test-live lint bench fuzz train train-trial pictures system-packages lock clean

# Needs the rig only; where everything is set up for development, that serves as well. What a busy
# machine leaves INVALID (3) keeps nobody from the rest.
demo: $(if $(wildcard .venv/ready),.venv/ready,.venv/rig-ready) ## the main jobs: four cars, a replay, a platoon, shared sensing
	$(PYTHON) -m sim_rig run fig4 || [ $$? -eq 3 ]
	$(PYTHON) -m onboard replay out/fig4-live/box/red --expect
	$(PYTHON) -m sim_rig run platoon --virtual
	$(PYTHON) -m sim_rig run shared-detection || [ $$? -eq 3 ]

# While one core checks the types, the other compiles: else each worker of pytest compiles all tests,
# and each daemon that a test starts compiles itself. What cannot be imported, the tests tell.
test test-long bytecode: export PYTHONDONTWRITEBYTECODE :=
test: .venv/ready system-packages ## the gate: style, types, short tests
	@$(MAKE) --no-print-directory --jobs 2 lint bytecode
	$(PYTEST) -m "not long and not live and not browser"

bytecode: .venv/ready ## the tests, compiled
	@$(PYTHON) -m pytest -qq --collect-only --ignore=tests/browser > /dev/null || true

# Whole drives, studies, rendered images, and searches of many examples.
test-long: .venv/ready system-packages ## whole drives, studies, rendered images
	$(PYTEST) -m "long and not live and not browser"

# The pages in a real browser, in real time; skipped with a word where chromium cannot be had.
test-pages: .venv/ready .venv-axe/ready ## the pages in chromium
	@sh tools/system-packages.sh chromium
	PYTHONPATH=.venv-axe $(PYTHON) -m pytest tests/browser

.venv-axe/ready: tests/browser/axe.lock
	$(PYTHON) -m pip install --quiet --no-deps --require-hashes --target .venv-axe -r $<
	@touch $@

# What docs/plates.md and docs/vision.md tell of the camera, measured anew and written there. Needs
# the photographs (RIG_DATA), for the baseline Tesseract and tesserocr, and a quiet machine.
.PHONY: vision-figures
vision-figures: .venv/ready ## the camera's figures, measured and written to its pages
	$(PYTHON) -m bench.vision
	$(PYTHON) -m bench.plates
	$(PYTHON) -m bench.plate_range
	$(PYTHON) -m bench.vision_drives
	$(PYTHON) -m bench.clips
	$(PYTHON) -m bench.vehicles

# The pictures of the pages in docs, from the running demonstration.
pictures: .venv/ready ## the pictures of the pages in docs
	@sh tools/system-packages.sh chromium
	$(PYTHON) -m tools.page_pictures
	$(PYTHON) -m tools.wiring_picture

# Every scenario with real daemons, one after the other: half an hour.
test-live: .venv/ready ## every scenario with real daemons
	$(PYTHON) -m pytest -m live tests/sim_rig

# Insiders with valid keys: the false alarms that they raise, and the true ones that are missed.
.PHONY: attack
attack: .venv/ready ## insiders with valid keys
	$(PYTHON) -m sim_rig study attacks

# A small Debian in QEMU, installed from the box, driven and ill-treated; no KVM needed. And the
# same in namespaces of this machine (as root), at its speed and without what needs a kernel. What
# these targets, box-ladder and hil-test measure is written to docs/tables/box-tests.csv.
.PHONY: vm-test box-test box-ladder box
vm-test: .venv/ready ## the box in QEMU, as root
	$(PYTHON) -m deploy.vm

box-test: .venv/ready ## the box in namespaces, as root
	$(PYTHON) -m deploy.vm --namespaces

# One scenario in virtual time, with processes, and with the box of box-test as one of its cars.
box-ladder: .venv/ready ## a scenario from virtual time up to the installed box, as root
	$(PYTHON) -m deploy.vm.ladder

# The same with the box of vm-test in QEMU: its bus is a serial line with slcan, the rig outside. In a
# network namespace, since its ports are those of other boxes too.
.PHONY: vm-ladder
vm-ladder: .venv/ready ## a scenario up to the box in QEMU, after vm-test, as root
	unshare --net sh -c 'ip link set lo up && exec $(PYTHON) -m deploy.vm.qemu_ladder'

# Installations of build/box that are ended at random moments; another call goes on.
.PHONY: power-cuts
power-cuts: .venv/ready box ## 50 installations that are cut: does every box come up?
	$(PYTHON) -m deploy.power_cuts build/box --table docs/tables/power-cuts.csv

# The rig and a box without hardware: a daemon in namespaces; no root. Then recordings of other kinds.
.PHONY: hil-test
hil-test: .venv/ready ## rig and box without hardware
	PYTHON=$(PYTHON) examples/box/namespaces.sh
	$(PYTHON) -m pytest -m live tests/sim_rig/runs/test_play.py
	$(PYTHON) -m deploy.box_tests hil-test out/box/ladder.csv

# The drives that tests replay, recorded anew after a change of the cores that is meant.
drives: .venv/ready ## records the drives of the tests anew
	$(PYTHON) -m tests.drives.record

# Everything that goes onto a box, in one folder: copy it there and run its install.sh.
box: .venv/ready ## everything to install on a box, in build/box
	sh deploy/box.sh build/box

# The same as a Debian package, and what dpkg does with it in namespaces. lintian finds nothing in it.
.PHONY: deb deb-test
deb: box ## the box as a Debian package, in build
	sh deploy/deb/deb.sh build/box build

deb-test: .venv/ready ## the package in namespaces, as root
	$(PYTHON) -m deploy.vm.deb

# Fresh clone, fresh home, then the wheel in an empty folder; `sh tools/newcomer.sh long` has demo and test too.
.PHONY: newcomer
newcomer: ## the first hour, each step timed
	sh tools/newcomer.sh

lint: .venv/ready ## style and types only
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m mypy

bench: .venv/ready ## all measurements
	$(PYTHON) -m bench

# The fuzzer has wheels for x86-64 only.
fuzz: .venv/ready .venv-fuzz/ready ## damaged input for every decoder
	PYTHONPATH=.venv-fuzz $(PYTHON) -m fuzz --seconds 20

.venv-fuzz/ready: fuzz/requirements.lock
	$(PYTHON) -m pip install --quiet --no-deps --require-hashes --target .venv-fuzz -r $<
	@touch $@

# Every comparison of the requests to brake and of misbehaviour detection changed, one at a time.
.PHONY: mutate
mutate: .venv/ready .venv-mutation/ready ## changed comparisons, each of which must fail a test
	PYTHONPATH=.venv-mutation $(PYTHON) -m tools.mutation

.venv-mutation/ready: tools/mutation.lock
	$(PYTHON) -m pip install --quiet --no-deps --require-hashes --target .venv-mutation -r $<
	@touch $@

# The pages, searchable, with one of docstrings for each package; nothing is fetched when they are read.
.PHONY: site
site: .venv-site/ready ## the documentation as a site, in build/site
	python3 tools/site_pages.py build/pages
	NO_MKDOCS_2_WARNING=1 .venv-site/bin/mkdocs build --quiet
	@echo "read it: python3 -m http.server --directory build/site --bind 127.0.0.1"

.venv-site/ready: tools/site.lock
	python3 -m venv .venv-site
	.venv-site/bin/python -m pip install --quiet --no-deps --require-hashes -r $<
	@touch $@

# The plate networks, from rendered pictures to ONNX; see docs/plates.md for how long it takes.
train: .venv-training/ready ## trains the networks
	.venv-training/bin/python -m training detector
	.venv-training/bin/python -m training reader
	.venv-training/bin/python -m training vehicles

# The same from end to end in some minutes, of too little to learn from: whether it works at all.
train-trial: .venv-training/ready ## the same on too little to learn from
	.venv-training/bin/python -m training detector $(TRIAL)
	.venv-training/bin/python -m training reader $(TRIAL)
	.venv-training/bin/python -m training vehicles $(TRIAL)

TRIAL := --settings training/trial.yaml --folder build/trial --models build/trial

.venv-training/ready: training/requirements.lock
	python3 -m venv .venv-training
	.venv-training/bin/python -m pip install --quiet --no-deps -r $<
	@touch $@

system-packages: ## Debian packages that tests compare with
	@sh tools/system-packages.sh

.venv/ready: requirements.lock pyproject.toml tools/set-up.sh
	sh tools/set-up.sh requirements.lock
	@touch $@

.venv/rig-ready: requirements-rig.lock pyproject.toml tools/set-up.sh
	sh tools/set-up.sh requirements-rig.lock
	@touch $@

# The lock covers the car, the rig with its studies, and development; fuzzing and training have their
# own. What of it the demo needs stands again in requirements-rig.lock, with setuptools to install
# this project, and what goes into a car in deploy/, for its installer.
LOCK := .venv/bin/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-header
lock: ## pins all versions anew
	$(LOCK) --extra rig --extra studies --extra sumo --extra cluster --extra dev pyproject.toml -o requirements.lock
	echo setuptools | $(LOCK) --extra rig --no-annotate --constraint requirements.lock pyproject.toml - -o requirements-rig.lock
	$(LOCK) --no-annotate --constraint requirements.lock pyproject.toml -o deploy/requirements.lock
	echo 'axe-playwright-python>=0.1.8' | $(LOCK) --no-annotate --no-deps - -o tests/browser/axe.lock
	echo 'mutmut>=3.8' | $(LOCK) --no-annotate --constraint requirements.lock - -o tools/mutation.lock
	printf '%s\n' 'mkdocs-material>=9.8' 'mkdocstrings[python]>=1.0' | $(LOCK) --no-annotate --constraint requirements.lock - -o tools/site.lock
	printf '%s\n' "atheris<3.1; python_version < '3.12'" "atheris>=3.1; python_version >= '3.12'" | $(LOCK) --no-annotate - -o fuzz/requirements.lock
	echo pip | $(LOCK) --no-annotate - -o deploy/installer.lock

clean: ## removes .venv, build and out
	rm -rf .venv .venv-fuzz .venv-mutation .venv-site .venv-axe build mutants out
