# `make demo` runs the main job, `make test` passes the tests; both set themselves up in .venv.
PYTHON := .venv/bin/python
.PHONY: demo test lint bench system-packages clean

demo: .venv/ready
	$(PYTHON) -m sim_rig run fig4

test: .venv/ready system-packages lint
	$(PYTHON) -m pytest -n 2 --dist worksteal

lint: .venv/ready
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m mypy

bench: .venv/ready
	$(PYTHON) -m bench

system-packages:
	@sh tools/system-packages.sh

.venv/ready: requirements.lock pyproject.toml tools/set-up.sh
	sh tools/set-up.sh
	@touch $@

# The lock covers the car, the rig, development and fuzzing; training has its own (training/).
lock:
	.venv/bin/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-header \
	    --extra rig --extra dev --extra fuzz pyproject.toml -o requirements.lock

clean:
	rm -rf .venv build out
