# `make demo` runs the main jobs, `make test` passes the tests; both set themselves up in .venv.
PYTHON := .venv/bin/python
PYTEST := $(PYTHON) -m pytest -n 2 --dist worksteal --durations=15 --durations-min=1
.PHONY: demo test test-long drives test-pages test-live lint bench fuzz train train-trial pictures system-packages lock clean

# Needs the rig only; where everything is set up for development, that serves as well.
demo: $(if $(wildcard .venv/ready),.venv/ready,.venv/rig-ready)
	$(PYTHON) -m sim_rig run fig4
	$(PYTHON) -m onboard replay out/fig4-live/box/red --expect
	$(PYTHON) -m sim_rig run platoon --virtual
	$(PYTHON) -m sim_rig run shared-detection

test: .venv/ready system-packages lint
	$(PYTEST) -m "not long and not live and not browser"

# Whole drives, studies, rendered images, and searches of many examples.
test-long: .venv/ready system-packages
	$(PYTEST) -m "long and not live and not browser"

# The pages in a real browser, in real time; skipped with a word where chromium cannot be had.
test-pages: .venv/ready
	@sh tools/system-packages.sh chromium
	$(PYTHON) -m pytest tests/browser

# What docs/plates.md and docs/vision.md tell of the camera, measured anew and written there. Needs
# the photographs (RIG_DATA), for the baseline Tesseract and tesserocr, and a quiet machine.
.PHONY: vision-figures
vision-figures: .venv/ready
	$(PYTHON) -m bench.vision
	$(PYTHON) -m bench.plates
	$(PYTHON) -m bench.plate_range
	$(PYTHON) -m bench.vision_drives
	$(PYTHON) -m bench.clips
	$(PYTHON) -m bench.vehicles

# The pictures of the pages in docs, from the running demonstration.
pictures: .venv/ready
	@sh tools/system-packages.sh chromium
	$(PYTHON) -m tools.page_pictures

# Every scenario with real daemons, one after the other: some ten minutes.
test-live: .venv/ready
	$(PYTHON) -m pytest -m live tests/sim_rig

# Insiders with valid keys: the false alarms that they raise, and the true ones that are missed.
.PHONY: attack
attack: .venv/ready
	$(PYTHON) -m sim_rig study attacks

# A small Debian in QEMU, installed from the box, driven and ill-treated; no KVM needed. And the
# same in namespaces of this machine (as root), at its speed and without what needs a kernel.
.PHONY: vm-test box-test box-ladder box
vm-test: .venv/ready
	$(PYTHON) -m deploy.vm

box-test: .venv/ready
	$(PYTHON) -m deploy.vm --namespaces

# One scenario in virtual time, with processes, and with the box of box-test as one of its cars.
box-ladder: .venv/ready
	$(PYTHON) -m deploy.vm.ladder

# The rig and a box without hardware: a daemon in namespaces; no root.
.PHONY: hil-test
hil-test: .venv/ready
	PYTHON=$(PYTHON) examples/box/namespaces.sh

# The drives that tests replay, recorded anew after a change of the cores that is meant.
drives: .venv/ready
	$(PYTHON) -m tests.drives.record

# Everything that goes onto a box, in one folder: copy it there and run its install.sh.
box: .venv/ready
	sh deploy/box.sh build/box

lint: .venv/ready
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m mypy

bench: .venv/ready
	$(PYTHON) -m bench

fuzz: .venv/ready
	$(PYTHON) -m fuzz --seconds 20

# The plate networks, from rendered pictures to ONNX; see docs/plates.md for how long it takes.
train: .venv-training/ready
	.venv-training/bin/python -m training detector
	.venv-training/bin/python -m training reader
	.venv-training/bin/python -m training vehicles

# The same from end to end in some minutes, of too little to learn from: whether it works at all.
train-trial: .venv-training/ready
	.venv-training/bin/python -m training detector $(TRIAL)
	.venv-training/bin/python -m training reader $(TRIAL)
	.venv-training/bin/python -m training vehicles $(TRIAL)

TRIAL := --settings training/trial.yaml --folder build/trial --models build/trial

.venv-training/ready: training/requirements.lock
	python3 -m venv .venv-training
	.venv-training/bin/python -m pip install --quiet --no-deps -r $<
	@touch $@

system-packages:
	@sh tools/system-packages.sh

.venv/ready: requirements.lock pyproject.toml tools/set-up.sh
	sh tools/set-up.sh requirements.lock
	@touch $@

.venv/rig-ready: requirements-rig.lock pyproject.toml tools/set-up.sh
	sh tools/set-up.sh requirements-rig.lock
	@touch $@

# The lock covers the car, the rig, development and fuzzing; training has its own (training/).
# What of it the demo needs stands again in requirements-rig.lock, with setuptools to install this
# project, and what goes into a car in deploy/, for its installer.
LOCK := .venv/bin/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-header
lock:
	$(LOCK) --extra rig --extra cluster --extra dev --extra fuzz pyproject.toml -o requirements.lock
	echo setuptools | $(LOCK) --extra rig --no-annotate --constraint requirements.lock pyproject.toml - -o requirements-rig.lock
	$(LOCK) --no-annotate --constraint requirements.lock pyproject.toml -o deploy/requirements.lock

clean:
	rm -rf .venv build out
