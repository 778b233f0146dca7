# make demo renders the first picture, make test runs every test, make bench measures time against error, make gallery
# renders all scenes; all first install what the machine lacks.

CARGO ?= cargo
TARGET := $(or $(CARGO_TARGET_DIR),target)

.PHONY: demo test bench gallery setup setup-test

demo: setup
	$(CARGO) build --release
	@mkdir -p out
	$(TARGET)/release/mesoshell render scenes/fur-sphere.toml -o out/fur-sphere.png
	@echo "the picture is in out/fur-sphere.png"

bench: setup
	$(CARGO) build --release
	$(TARGET)/release/mesoshell bench benches/default.toml --output out/bench
	@echo "the report is in out/bench/report.html"

# The scenes of the 2005 paper first; none comes twice.
gallery: setup
	$(CARGO) build --release
	$(TARGET)/release/mesoshell gallery $(wildcard scenes/table1 scenes/figure1 scenes/figure5) scenes -o out/gallery
	@echo "the page is out/gallery/index.html"

test: setup-test
	$(CARGO) test --release

setup:
	@CARGO="$(CARGO)" .ci/setup

setup-test:
	@CARGO="$(CARGO)" .ci/setup test
