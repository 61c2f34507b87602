# make demo     scan, record, process and fit a virtual paint, with pictures: out/demo
# make test     every test, formatting and lints
# make test-hil the driver against the drivers of a real kernel, in a small machine with virtual USB devices; ARGS="--without camera", "--watch-s 600", "--runs 20"
# make test-genicam  GenICam cameras, with Aravis' fake camera on loopback
# make campaign the reliability campaigns at full size, hours in all; ONLY=name, SHARE=0.01 for a part of it, SEED=n; writes docs/reliability.md
# make figures  the figures this project promises, each with value, bound, seed and command; ONLY=name for one of them
SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c
TARGET := $(or $(CARGO_TARGET_DIR),target)
export GONIO_PYTHON ?= $(abspath $(TARGET))/python/bin/python

.PHONY: demo test test-hil test-genicam figures campaign build clean

demo: build
	$(TARGET)/release/gonio demo -o out/demo --force
	@echo "Pictures and report: out/demo (open out/demo/demo.report.html)"

build:
	@scripts/set-up build
	cargo build --release --locked -p gonio

test:
	@scripts/set-up test
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings
	cargo test --locked --workspace 2>&1 | tee $(TARGET)/test.log
	@scripts/data-tally $(TARGET)/test.log

test-hil:
	@scripts/set-up build
	@scripts/hil set-up
	cargo build --locked -p gonio -p gonio-hil
	$(TARGET)/debug/hil --files $(TARGET)/hil --programs $(TARGET)/debug $(ARGS)

test-genicam:
	@scripts/set-up genicam
	cargo clippy --locked -p gonio-driver --features genicam --all-targets -- -D warnings
	cargo test --locked -p gonio-driver --features genicam --test genicam

figures:
	@scripts/set-up build
	@cargo run --quiet --release --locked -p gonio-tests --bin figures -- $(ONLY)

campaign:
	@scripts/set-up build
	@cargo run --quiet --release --locked -p gonio-tests --bin campaign -- "$(or $(ONLY),all)" "$(SHARE)" "$(SEED)" docs/reliability.md

clean:
	cargo clean
	rm -rf out
