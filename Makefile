# Firn's commands. `make` alone lists them.

CARGO ?= cargo
# More options for the server, as in: make serve ARGS="--listen 127.0.0.1:9000"
ARGS ?=

# Mesa's device chooser looks for a display and complains where there is none; Firn chooses by itself.
export NODEVICE_SELECT := 1

.DEFAULT_GOAL := help
.PHONY: help serve demo test test-long fuzz-api deny viewer test-viewer test-python test-unity driver build dist fmt lint lint-api \
	lint-deploy openapi client-types \
	configuration clean

help: ## list these commands
	@awk -F ':.* ## ' '/^[a-z-]+:.* ## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

serve: ## build, make sure there is a Vulkan driver, serve with a demo session and the viewer
	@$(MAKE) --no-print-directory viewer || echo "Going on without: the server's page says how to get the viewer."
	@scripts/vulkan-driver || echo "Going on without: the server computes on the CPU."
	$(CARGO) run --release --locked -- serve --demo $(ARGS)

demo: ## build, make sure there is a Vulkan driver, play the demo scene until it is interrupted
	@$(MAKE) --no-print-directory viewer || echo "Going on without: the server's page says how to get the viewer."
	@scripts/vulkan-driver || echo "Going on without: the server computes on the CPU."
	$(CARGO) build --release --locked --bin firn --example game_server
	@scripts/demo

# The viewer is built anew where something it is made of is newer. Its tools come from Node, which scripts/node finds or fetches.
viewer: viewer/dist/index.html ## build the viewer, the server's web page

viewer_sources := $(shell find viewer/src clients/typescript/src -type f 2>/dev/null) \
	$(wildcard viewer/*.html viewer/*.json viewer/*.ts)

viewer/dist/index.html: viewer/node_modules/.package-lock.json $(viewer_sources)
	path="$$(scripts/node)" && cd viewer && PATH="$$path:$$PATH" npm run build

%/node_modules/.package-lock.json: %/package.json %/package-lock.json
	path="$$(scripts/node)" && cd $* && PATH="$$path:$$PATH" npm ci --no-fund --no-audit

# FIRN_SKIP_VIEWER_TESTS=1 leaves the TypeScript out: the client's tests, and the viewer's in Chromium.
# The server that the tests were built with: `cargo build` has other features of dependencies, and would build most of them again.
test-viewer: viewer clients/typescript/node_modules/.package-lock.json ## test the TypeScript client, and the viewer in Chromium
	$(CARGO) test --locked --workspace --no-run
	path="$$(scripts/node)" && export PATH="$$path:$$PATH" && set -x && \
		(cd clients/typescript && npm run check && npm test) && (cd viewer && npm run check && npm test)

run_tests = $(CARGO) $(if $(shell $(CARGO) nextest --version 2>/dev/null),nextest run --locked --workspace,test --locked --workspace --tests \
	--no-fail-fast)

simulation = $${CARGO_TARGET_DIR:-target}/debug/firn-sim

# CONTRIBUTING.md has the budget of each part.
# FIRN_SKIP_GPU_TESTS=1 leaves the GPU tests out, and with them the need for a driver.
test: ## make sure there is a Vulkan driver, check format and lints, run every test
	@scripts/part --begin
ifneq ($(FIRN_SKIP_GPU_TESTS),1)
	scripts/part driver scripts/vulkan-driver
endif
# The server holds the viewer's files: it would be built again for those that come later.
ifneq ($(FIRN_SKIP_VIEWER_TESTS),1)
	scripts/part viewer $(MAKE) --no-print-directory viewer
endif
	scripts/part lint $(MAKE) --no-print-directory lint
	scripts/part build-tests $(CARGO) test --locked --workspace --no-run
	scripts/part tests $(run_tests)
	scripts/part simulation $(simulation) --seeds 10 --steps 20000
	scripts/part doc-tests $(CARGO) test --locked --doc
	scripts/part fuzz-api scripts/fuzz-api 30
	scripts/part lint-api scripts/lint-api
	scripts/part client-types scripts/client-types --check
	scripts/part lint-deploy scripts/lint-deploy
	scripts/part test-python scripts/test-python
	scripts/part test-unity scripts/test-unity
ifeq ($(FIRN_SKIP_VIEWER_TESTS),1)
	@echo "SKIPPED: the tests of the viewer and of the TypeScript client, by FIRN_SKIP_VIEWER_TESTS=1"
else
	scripts/part test-viewer $(MAKE) --no-print-directory test-viewer
endif
	@scripts/part --end

test-long: ## what takes too long for every day: an hour of simulated faults, and 200 kills under load instead of 20
	$(CARGO) test --locked --workspace --no-run
	$(simulation) --seeds 4000 --steps 20000
	FIRN_KILL_ROUNDS=200 $(CARGO) test --locked --test durability kill -- --nocapture

fuzz-api: ## send a server what its OpenAPI document allows and what it doesn't, for two minutes
	scripts/fuzz-api 120

deny: ## check every dependency: licence, source, known vulnerabilities, use; takes cargo-deny and cargo-machete
	$(CARGO) deny --locked check
	$(CARGO) machete

driver: ## make sure there is a Vulkan driver; install the distribution's where there is none
	@scripts/vulkan-driver

build: ## build the server with optimisation
	$(CARGO) build --release --locked

dist: ## build the server as it is handed out: some minutes longer, a tenth faster to answer
	$(CARGO) build --profile dist --locked

fmt: ## format the code
	$(CARGO) fmt

lint: ## check format and lints, and that the documentation of the code has no broken links
	$(CARGO) fmt --all --check
	$(CARGO) clippy --locked --workspace --all-targets -- -D warnings
	$(CARGO) check --locked --quiet --package firn-snow --package firn-protocol
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --workspace --no-deps --quiet

openapi: ## write api/openapi.json anew from the handlers
	$(CARGO) run --release --locked -- openapi > target/openapi.json
	mv target/openapi.json api/openapi.json

client-types: ## make the clients' types anew from api/openapi.json and api/asyncapi.yaml
	scripts/client-types

configuration: ## write the table of options in docs/operations.md anew
	$(CARGO) run --release --locked -- configuration > target/configuration.md
	sed -i -e '/<!-- configuration -->/,/<!-- end -->/{//!d}' -e '/<!-- configuration -->/r target/configuration.md' \
		docs/operations.md

test-python: ## test the Python client and the stream's published contract against the server
	$(CARGO) test --locked --workspace --no-run
	scripts/test-python

test-unity: ## test the client for Unity, compiled by Mono
	$(CARGO) test --locked --workspace --no-run
	scripts/test-unity

lint-deploy: ## check the Dockerfile, compose.yaml and deploy/ with the linters of their formats
	scripts/lint-deploy

lint-api: ## check api/openapi.json and api/asyncapi.yaml with the linters of their formats
	scripts/lint-api

clean: ## remove everything that was built
	$(CARGO) clean
	rm -rf .node viewer/dist viewer/node_modules viewer/screenshots clients/typescript/dist clients/typescript/node_modules \
		clients/generate/node_modules api/lint/node_modules
