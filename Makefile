# Everything runs in a private environment: PyPI wheels, ROS 2 Jazzy among them, and this checkout.
# Ready, it has what the demo and the dashboard need; complete, also what tests and documentation do.
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
COMPLETE := $(VENV)/.complete

# The first that runs (a pyenv shim may not) and that the ROS wheels are made for.
SUITS := -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))'
PYTHON ?= $(shell for python in python3.12 python3.13 python3.11 python3; do \
	$$python $(SUITS) 2>/dev/null && echo $$python && break; done)

# uv takes a tenth of the time of pip: the one on PATH, or one that pip puts into the environment.
# It is told which packages pip is told to take, and from where. Where it fails, or UV is empty, pip
# installs. Python 3.11 comes with a pip that takes twice as long: it is replaced first.
UV ?= $(shell command -v uv || echo $(BIN)/uv)
PIP := $(BIN)/python -m ensurepip --default-pip >/dev/null && \
	$(BIN)/python -m pip install -qq --disable-pip-version-check
PIP_FILES := /etc/xdg/pip/pip.conf /etc/pip.conf ~/.pip/pip.conf \
	$${XDG_CONFIG_HOME:-~/.config}/pip/pip.conf $$PIP_CONFIG_FILE
configured = $$(sed -n 's/^$(1) *= *//p' $(PIP_FILES) 2>/dev/null | tail -n 1)
define install
@test -z '$(UV)' || test -x '$(UV)' || { $(PIP) uv; }; \
UV_CONSTRAINT=$${UV_CONSTRAINT:-$${PIP_CONSTRAINT:-$(call configured,constraint)}} \
UV_DEFAULT_INDEX=$${UV_DEFAULT_INDEX:-$${PIP_INDEX_URL:-$(call configured,index-url)}} \
$(or $(UV),false) pip install --quiet --python $(BIN)/python \
	--reinstall-package stickslip_ros pip --editable '.[$(EXTRAS)]' || \
{ $(PIP) --upgrade pip && $(PIP) --editable '.[$(EXTRAS)]'; }
endef

# A test that hangs fails by itself, with its name. What was skipped is listed at the end, and why.
# Three at a time on two cores: some of it is waiting. Of what takes long, more is.
PYTEST := $(BIN)/python -m pytest $(TESTS) --timeout=600 --numprocesses=3 --dist=worksteal -rs

# What Python compiles is kept, even if the environment says not to: the tests start hundreds.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: setup demo check test-quick slow test test-all lint site gallery reproduction bench \
	screenshot clean

setup: $(COMPLETE)

$(READY): EXTRAS := ros,dashboard
$(COMPLETE): EXTRAS := ros,dashboard,test,dev,docs

# The stamp is set last. Without it the environment was interrupted, and pip cannot tell half
# installed packages from whole ones: it is cleared and filled again, mostly from a cache.
# An editable install leaves data files out: what ament and `ros2 run` look for is linked.
$(READY): setup.py setup.cfg pyproject.toml package.xml Makefile
	@python='$(PYTHON)'; \
	$${python:-false} $(SUITS) 2>/dev/null || { \
		echo 'This needs Python 3.11, 3.12 or 3.13: sudo apt-get install python3 python3-venv,' \
			'or name one: make PYTHON=/path/to/python3' >&2; exit 1; }; \
	$$python -c 'import ensurepip, venv' 2>/dev/null || { \
		$$python -c 'import sys; print("This needs venv: sudo apt-get install" \
			" python%d.%d-venv" % sys.version_info[:2])' >&2; exit 1; }; \
	echo "setting up $(VENV) with $$($$python --version) (half a minute, once)"; \
	test -e $@ || $$python -m venv --clear --without-pip $(VENV)
	@rm -f $@
	$(install)
	@rm -rf $(VENV)/lib/stickslip_ros $(VENV)/share/stickslip_ros
	@mkdir $(VENV)/lib/stickslip_ros $(VENV)/share/stickslip_ros
	@ln -s '$(CURDIR)/config' '$(CURDIR)/package.xml' $(VENV)/share/stickslip_ros
	@ln -sf '$(CURDIR)/resource/stickslip_ros' $(VENV)/share/ament_index/resource_index/packages
	@cd $(VENV)/lib/stickslip_ros && ../../bin/python -c 'from importlib import metadata; \
		scripts = metadata.distribution("stickslip_ros").entry_points.select(group="console_scripts"); \
		print(*scripts.names, sep="\n")' | \
		xargs -I{} ln -s ../../bin/{} {}
	@touch $@

$(COMPLETE): $(READY)
	@echo 'adding what the tests and the documentation need'
	@rm -f $(READY)
	$(install)
	@touch $(READY) $@

demo: $(READY)
	$(BIN)/python -m stickslip_ros.app.demo

# The loop for those who change something: linters, types, and the tests that start no process.
# One process for types, one for tests: each further one would import everything again.
check: setup
	@$(MAKE) --no-print-directory --jobs=2 --output-sync=target lint test-quick

test-quick: setup
	$(PYTEST) --numprocesses=0 -m 'not process and not long and not slow' $(PYTEST_OPTIONS)

# Which tests are slow, by the processor time that they take: tests/slow.txt.
slow: setup
	$(PYTEST) -m 'not process and not long' -p tests.slow $(PYTEST_OPTIONS)

# What a fresh machine should pass.
test: setup
	$(PYTEST) -m 'not long' $(PYTEST_OPTIONS)

# Besides, what takes long, and what needs a browser, a network of its own or new environments. A
# test that is far too slow for `make check` and not listed fails.
test-all: setup
	$(PYTEST) --numprocesses=4 --hypothesis-profile=thorough -p tests.slow --slow-tests=known \
		$(PYTEST_OPTIONS)

lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright --pythonpath $(BIN)/python

# Numbers as a processor without AVX and FMA rounds them, for BLAS, numpy and the C library choose
# by the processor; heyoka cannot be told. It finds bounds that hold on one processor by luck.
.PHONY: test-sse
test-sse: setup
	OPENBLAS_CORETYPE=Nehalem NPY_DISABLE_CPU_FEATURES='X86_V3 X86_V4 AVX512_ICL AVX512_SPR' \
		GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4 \
		$(BIN)/python -m pytest tests/motion tests/theory --timeout=600 --numprocesses=3 \
		--dist=worksteal -m 'not long and not hypothesis' $(PYTEST_OPTIONS)

# A table, and the same as JSON; needs a quiet machine. What lacks a browser, say, is skipped (77).
bench: setup
	@mkdir -p build
	$(BIN)/python -m benchmarks --out build/benchmarks.json || test $$? -eq 77

# The documentation as a web site: build/site/index.html.
site: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# The figures of docs/gallery.md, drawn again by the scripts and notebooks.
gallery: setup
	$(BIN)/python docs/gallery.py

# The paper's figures drawn and its claims judged again: docs/reproduction.md.
reproduction: setup
	$(BIN)/python -m reproduction

# The picture of the dashboard in README.md; needs a browser, and a machine that has time for it.
screenshot: setup
	$(BIN)/python -m docs.screenshot docs

clean:
	rm -rf .venv .venv-* build install log dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
