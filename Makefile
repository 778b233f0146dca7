# make demo renders the first picture, make test runs every test, make bench measures time against error, make gallery
# renders all scenes, make recipe-pictures draws those of docs/volumes.md; all first install what the machine lacks.

CARGO ?= cargo
TARGET := $(or $(CARGO_TARGET_DIR),target)

.PHONY: demo test bench bench-speed bench-scaling bench-gate gallery recipe-pictures setup setup-test

demo: setup
	$(CARGO) build --release
	@mkdir -p out
	$(TARGET)/release/mesoshell render scenes/fur-sphere.toml -o out/fur-sphere.png
	@echo "the picture is in out/fur-sphere.png"

bench: setup
	$(CARGO) build --release
	$(TARGET)/release/mesoshell bench benches/default.toml --output out/bench
	@echo "the report is in out/bench/report.html"

# How much faster than the paper's plan its scenes are drawn with no more error.
bench-speed: setup
	$(CARGO) build --release
	$(TARGET)/release/mesoshell bench --suite speed --output out/bench-speed
	@echo "the report is in out/bench-speed/report.html"

# How time and memory grow with tetrahedra, pixels and texels.
bench-scaling: setup
	$(CARGO) build --release
	$(TARGET)/release/mesoshell bench --suite scaling --output out/bench-scaling
	@echo "the report is in out/bench-scaling/scaling.html"

# Fails where such ratios have fallen by more than 15 % since benches/gate.json was committed.
bench-gate: setup
	$(CARGO) build --release
	$(TARGET)/release/mesoshell bench --suite gate --baseline benches/gate.json --output out/bench-gate

# The scenes of the 2005 paper first; none comes twice.
gallery: setup
	$(CARGO) build --release
	$(TARGET)/release/mesoshell gallery scenes/table1 scenes/figure1 scenes/figure5 scenes/effects scenes -o out/gallery
	@echo "the page is out/gallery/index.html"

test: setup-test
	$(CARGO) test --release

PREVIEW := $(TARGET)/release/mesoshell volume preview

recipe-pictures: setup
	$(CARGO) build --release
	@mkdir -p docs/recipes
	$(PREVIEW) volumes/fur.toml -o docs/recipes/fur.png \
		--vary 'lean=0, clumping=0' \
		--vary 'length_variation=1, curl=0.03' \
		--vary 'crease=1'
	$(PREVIEW) volumes/grass.toml -o docs/recipes/grass.png \
		--vary 'density=150' \
		--vary 'bend=80, wind=1' \
		--vary 'tufting=1, tufts=4'
	$(PREVIEW) volumes/trees.toml -o docs/recipes/trees.png \
		--vary 'conifers=1' \
		--vary 'count=60, crown=0.07' \
		--vary 'raggedness=0, occlusion=0.4'
	$(PREVIEW) volumes/figure.toml -o docs/recipes/figure.png \
		--vary 'figure="dragon", turn=40' \
		--vary 'figure="chain"' \
		--vary 'figure="tree", variation=0.5'
	$(PREVIEW) volumes/fog.toml -o docs/recipes/fog.png \
		--vary 'scale=8' \
		--vary 'contrast=0' \
		--vary 'reach=0.4'
	$(PREVIEW) volumes/clouds.toml -o docs/recipes/clouds.png \
		--vary 'coverage=0.3' \
		--vary 'billowing=0' \
		--vary 'scale=4, billows=12'
	$(PREVIEW) volumes/ellipsoids.toml -o docs/recipes/ellipsoids.png \
		--vary 'elongation=0' \
		--vary 'alpha=0.9' \
		--vary 'medium_alpha=0.8'
	$(PREVIEW) volumes/uniform.toml -o docs/recipes/uniform.png \
		--vary 'alpha=0.3' \
		--vary 'alpha=0.97' \
		--vary 'colour="#c86432"'
	$(PREVIEW) volumes/rocks.toml -o docs/recipes/rocks.png \
		--vary 'largest=0.3' \
		--vary 'angularity=1, roughness=0.3' \
		--vary 'overlap=0.6, flatness=0.8'
	$(PREVIEW) volumes/weave.toml -o docs/recipes/weave.png \
		--vary 'pairs=8' \
		--vary 'width=0.4'
	$(PREVIEW) volumes/chain-mail.toml -o docs/recipes/chain-mail.png \
		--vary 'rings=8' \
		--vary 'backing=0, tarnish=0'
	$(PREVIEW) volumes/scales.toml -o docs/recipes/scales.png \
		--vary 'scales=9' \
		--vary 'outline=6' \
		--vary 'lift=0.8, thickness=0.1'
	$(PREVIEW) volumes/height-map.toml -o docs/recipes/height-map.png \
		--vary 'black=0.9, white=0.3' \
		--vary 'softness=0.05' \
		--vary 'grain=0, occlusion=0'

setup:
	@CARGO="$(CARGO)" .ci/setup

setup-test:
	@CARGO="$(CARGO)" .ci/setup test
