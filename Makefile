# Firn's commands. `make` alone lists them.

CARGO ?= cargo
# More options for the server, as in: make serve ARGS="--listen 127.0.0.1:9000"
ARGS ?=

# Mesa's device chooser looks for a display and complains where there is none; Firn chooses by itself.
export NODEVICE_SELECT := 1

.DEFAULT_GOAL := help
.PHONY: help serve test fuzz-api deny viewer test-viewer test-python test-unity driver build fmt lint lint-api lint-deploy openapi \
	configuration clean

help: ## list these commands
	@awk -F ':.* ## ' '/^[a-z-]+:.* ## / { printf "  make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

serve: ## build, make sure there is a Vulkan driver, serve with a demo session and the viewer
	@$(MAKE) --no-print-directory viewer || echo "Going on without: the server's page says how to get the viewer."
	@scripts/vulkan-driver || echo "Going on without: the server computes on the CPU."
	$(CARGO) run --release --locked -- serve --demo $(ARGS)

# The viewer is built anew where something it is made of is newer. Its tools come from Node, which scripts/node finds or fetches.
viewer: viewer/dist/index.html ## build the viewer, the server's web page

viewer_sources := $(shell find viewer/src clients/typescript/src -type f 2>/dev/null) \
	$(wildcard viewer/*.html viewer/*.json viewer/*.ts)

viewer/dist/index.html: viewer/node_modules/.package-lock.json $(viewer_sources)
	path="$$(scripts/node)" && cd viewer && PATH="$$path:$$PATH" npm run build

%/node_modules/.package-lock.json: %/package.json %/package-lock.json
	path="$$(scripts/node)" && cd $* && PATH="$$path:$$PATH" npm ci --no-fund --no-audit

# FIRN_SKIP_VIEWER_TESTS=1 leaves the TypeScript out: the client's tests, and the viewer's in Chromium.
test-viewer: viewer clients/typescript/node_modules/.package-lock.json ## test the TypeScript client, and the viewer in Chromium
	$(CARGO) build --locked
	path="$$(scripts/node)" && export PATH="$$path:$$PATH" && set -x && \
		(cd clients/typescript && npm run check && npm test) && (cd viewer && npm run check && npm test)

# FIRN_SKIP_GPU_TESTS=1 leaves the GPU tests out, and with them the need for a driver.
test: $(if $(filter 1,$(FIRN_SKIP_GPU_TESTS)),,driver) lint ## make sure there is a Vulkan driver, check format and lints, run every test
	@if $(CARGO) nextest --version >/dev/null 2>&1; then set -x; \
		$(CARGO) test --locked --doc && $(CARGO) nextest run --locked; \
	else set -x; \
		$(CARGO) test --locked --no-fail-fast; \
	fi
	$(CARGO) build --locked
	scripts/fuzz-api 30
	scripts/lint-api
	scripts/lint-deploy
	scripts/test-python
	scripts/test-unity
ifeq ($(FIRN_SKIP_VIEWER_TESTS),1)
	@echo "SKIPPED: the tests of the viewer and of the TypeScript client, by FIRN_SKIP_VIEWER_TESTS=1"
else
	@$(MAKE) --no-print-directory test-viewer
endif

fuzz-api: ## send a server what its OpenAPI document allows and what it doesn't, for two minutes
	scripts/fuzz-api 120

deny: ## check every dependency's licence, source and known vulnerabilities; takes cargo-deny
	$(CARGO) deny --locked check

driver: ## make sure there is a Vulkan driver; install the distribution's where there is none
	@scripts/vulkan-driver

build: ## build the server with optimisation
	$(CARGO) build --release --locked

fmt: ## format the code
	$(CARGO) fmt

lint: ## check format and lints
	$(CARGO) fmt --check
	$(CARGO) clippy --locked --all-targets -- -D warnings

openapi: ## write api/openapi.json anew from the handlers
	$(CARGO) run --release --locked -- openapi > target/openapi.json
	mv target/openapi.json api/openapi.json

configuration: ## write the table of options in docs/operations.md anew
	$(CARGO) run --release --locked -- configuration > target/configuration.md
	sed -i -e '/<!-- configuration -->/,/<!-- end -->/{//!d}' -e '/<!-- configuration -->/r target/configuration.md' \
		docs/operations.md

test-python: ## test the Python client and the stream's published contract against the server
	$(CARGO) build --locked
	scripts/test-python

test-unity: ## test the client for Unity, compiled by Mono
	$(CARGO) build --locked
	scripts/test-unity

lint-deploy: ## check the Dockerfile, compose.yaml and deploy/ with the linters of their formats
	scripts/lint-deploy

lint-api: ## check api/openapi.json and api/asyncapi.yaml with the linters of their formats
	scripts/lint-api

clean: ## remove everything that was built
	$(CARGO) clean
	rm -rf .node viewer/dist viewer/node_modules viewer/screenshots clients/typescript/dist clients/typescript/node_modules \
		api/lint/node_modules
