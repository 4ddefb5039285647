# Two commands do everything: `make run` and `make test`. Both set up what they need.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help run test soak build tools python format lint rust docs python-test keys clean

CELL ?= config/cells/dual_arm.yaml
DEMO ?= config/motions/handover.json
MINUTES ?= 5
SEED ?= 1
VENV := .venv
PYTHON := $(VENV)/bin/python
PACKAGE := protocol/python

help:
	@echo "make run    set up, build, start the default cell and move it (Ctrl-C ends it)"
	@echo "make test   set up, run every check and test"
	@echo "make soak   two arms, with failures at random for MINUTES=5 from SEED=1 (Linux, root)"
	@echo "make keys   write protocol/KEYS.md and protocol/keys.json from the tables"

run: build
	target/release/armada up $(CELL) --demo $(DEMO)

build: tools
	cargo build --release

# Names what is missing and how to get it.
tools:
	@missing=0; \
	command -v cargo >/dev/null || { missing=1; \
	  echo "Rust is missing: install it with rustup (https://rustup.rs), then run make again."; }; \
	command -v cc >/dev/null || { missing=1; \
	  echo "A C linker is missing: on Debian or Ubuntu, apt-get install build-essential."; }; \
	exit $$missing

test: tools python format lint rust docs python-test
	@echo "All checks passed."

# The Python package with its tests, in an environment of the project's own.
python: $(VENV)/.installed

$(VENV)/.installed: $(PACKAGE)/pyproject.toml
	@command -v python3 >/dev/null || { echo "Python 3.10 or newer is missing."; exit 1; }
	@python3 -m venv $(VENV) || { \
	  echo "python3 -m venv failed: on Debian or Ubuntu, apt-get install python3-venv."; exit 1; }
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --editable '$(PACKAGE)[dev]'
	@touch $@

format:
	cargo fmt --all --check

lint: tools
	cargo clippy --workspace --all-targets -- -D warnings

# One build of the whole workspace, the programs that whole-cell tests start with it. Those tests
# (`cells`, `matrix`) run one at a time; they are chosen by name, since with other packages Zenoh has
# other features and would be built once more.
rust: tools python
	@if cargo nextest --version >/dev/null 2>&1; then \
	  cargo nextest run --workspace; \
	else \
	  cargo test --workspace --lib --bins --test '[!cm]*' --test 'c[!e]*' --test 'm[!a]*'; \
	  cargo test --workspace --test cells --test matrix -- --test-threads=1; \
	fi
	cargo test --workspace --doc

# Built with the whole workspace, the program that it starts with it.
soak: tools
	cargo build --release --workspace --bins --examples
	target/release/examples/soak --minutes $(MINUTES) --seed $(SEED)

docs: tools
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

python-test: python
	$(VENV)/bin/ruff check $(PACKAGE)
	$(VENV)/bin/ruff format --check $(PACKAGE)
	cd $(PACKAGE) && ../../$(VENV)/bin/mypy
	cd $(PACKAGE) && ../../$(VENV)/bin/python -m pytest --quiet

# Built with the whole workspace: for one package alone Zenoh would be built anew.
keys: tools
	cargo build --workspace --examples
	target/debug/examples/generate_keys

clean:
	cargo clean
	rm -rf $(VENV)
