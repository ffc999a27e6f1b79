# SPDX-License-Identifier: Apache-2.0
# `make render` and `make test` work on a fresh machine. `make help` lists the other targets.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c

BUILD := build/editable
# Compile sources in unity batches. Unity batches make a clean build faster, but rebuilding after an
# edit slower, so that developers who edit C++ files often should set `BATCH=OFF`.
BATCH ?= ON
# Lane widths to compile: "default" means scalar code and the widest vectors of the target CPU, and
# "all" means every supported width. Later builds keep the lane widths of the last build.
LANES ?= $(shell cat build/.lanes 2> /dev/null || echo default)
# C++ tests that make test-asan builds: ON for the tests in which sanitizers can find errors, or all
# for every test.
CHECKS ?= ON
ASAN := build/asan$(if $(filter all,$(CHECKS)),-all)
TSAN := build/tsan
WHEEL := build/wheel
CLANG := build/clang
ARM64 := build/arm64
VENV := .venv/bin
# Instruction sets for which make wheels compiles the native library: portable, or a list in the
# format of the CMake option WAVECOMB_ISAS.
ISAS ?= portable
# Duration in minutes, first seed and number of processes of make fuzz.
MINUTES ?= 10
SEED ?= 1
JOBS ?= $(shell nproc 2> /dev/null || echo 2)
# Prefix that lets only one make process at a time build in a build directory.
LOCK := $(if $(shell command -v flock),flock build/.lock)
SETUP_LOCK := $(if $(LOCK),$(LOCK)-setup)
ASAN_LOCK := $(if $(LOCK),$(LOCK)-asan)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_NO_INPUT := 1
# The programs of .venv precede programs of the same name in PATH.
export PATH := $(CURDIR)/.venv/bin:$(PATH)

CMAKE_INPUTS := CMakeLists.txt $(wildcard cmake/*) $(wildcard tests/cpp/CMakeLists.txt tests/naive/CMakeLists.txt benchmarks/micro/CMakeLists.txt)
# `NATIVE_INPUTS` includes directories, so that adding or removing a source file causes a rebuild.
NATIVE_INPUTS := $(shell find src bindings 2> /dev/null)
CPP_FILES := $(shell find src bindings tests/cpp tests/naive benchmarks/micro examples cmake \( -name '*.cpp' -o -name '*.h' -o -name '*.inl' \) 2> /dev/null)

.PHONY: help setup setup-test build build-test-tools build-all-lanes build-lanes-before wheels sdist check-release release render docs test test-fast test-cpp test-cpp-long test-py test-py-fast run-py run-py-fast run-py-long test-long fuzz test-asan test-asan-all test-tsan test-wheel test-sdist test-clang test-arm64 setup-blender test-blender blender-extension bench lint format clean

help: ## Print this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# ---- set-up and build -------------------------------------------------------------------------

build/.setup: tools/setup tools/wheels tools/setup_embree tools/setup_openvdb tools/debs cmake/embree_probe.cpp cmake/openvdb_probe.cpp \
  constraints.txt pyproject.toml
	@mkdir -p build && $(SETUP_LOCK) tools/setup && touch $@

# Install the packages that tests need. make test does so while it builds the core.
build/.setup-test: build/.setup
	@$(SETUP_LOCK) tools/setup test && touch $@

# Install Doxygen for the C++ reference, which only make docs needs.
build/.setup-docs: build/.setup
	@$(SETUP_LOCK) tools/setup docs && touch $@

.PHONY: lanes
lanes:
build/.lanes: lanes
	@mkdir -p build; [ "$$(cat $@ 2> /dev/null)" = "$(LANES)" ] || echo "$(LANES)" > $@

# pip configures CMake, and builds and installs the package. After an edit of a source file, make
# build runs only CMake, which is faster.
build/.configured: build/.setup build/.lanes $(CMAKE_INPUTS) pyproject.toml $(wildcard .deps/openvdb/.complete)
	@echo "build: configuring"
	@$(LOCK) $(VENV)/python -m pip install -q --no-build-isolation --no-deps -e . --config-settings=build-dir=$(BUILD) \
	  --config-settings=cmake.define.WAVECOMB_TESTS=ON --config-settings=cmake.define.WAVECOMB_BENCHMARKS=ON \
	  --config-settings=cmake.define.WAVECOMB_BATCH=$(BATCH) \
	  --config-settings=cmake.define.WAVECOMB_LANE_WIDTHS="$(LANES:default=)"
	@touch $@

build/.built: build/.configured $(NATIVE_INPUTS)
	@echo "build: core and Python module"
	@$(LOCK) $(VENV)/cmake --build $(BUILD) --target wavecomb_python -j $(JOBS) -- --quiet
	@$(VENV)/cmake --install $(BUILD) --component python \
	  --prefix "$$($(VENV)/python -c 'import sysconfig; print(sysconfig.get_path("platlib"))')" > /dev/null
	@touch $@

setup: build/.setup ## Install build dependencies (system packages, .venv, Embree 4)
setup-test: build/.setup-test
build: build/.built ## Build the core and the Python module into .venv (editable); LANES=all builds every lane width

# Wavecomb's wheel contains the Embree library of .deps/embree, if there is one; pip installs all
# other dependencies from separate wheels. auditwheel must not copy system libraries, since the
# wheel already includes all that it needs.
wheels: build/.setup ## Build the distributable wheel in dist/, with every instruction set, checked by auditwheel
	@$(VENV)/python -c 'import auditwheel' 2> /dev/null || $(VENV)/python -m pip install -q -c constraints.txt 'auditwheel>=6.8'
	@echo "wheels: a library for each instruction set"
	@rm -rf $(WHEEL)/raw dist/wavecomb-*.whl
	@$(LOCK) $(VENV)/python -m pip wheel -q --no-build-isolation --no-deps -w $(WHEEL)/raw . \
	  --config-settings=build-dir=$(WHEEL) --config-settings=cmake.define.WAVECOMB_ISAS="$(ISAS)" \
	  --config-settings=cmake.define.WAVECOMB_BATCH=$(BATCH)
	@LD_LIBRARY_PATH=.venv/lib $(VENV)/auditwheel repair --plat auto -w dist $(WHEEL)/raw/wavecomb-*.whl --exclude libtbb.so.12 --exclude libembree4.so.4 \
	  $$($(VENV)/python -m zipfile -l $(WHEEL)/raw/wavecomb-*.whl | sed -n 's|^wavecomb/lib/\(lib[^ /]*\) .*|--exclude \1|p') \
	  2> >(grep -v '^INFO:' >&2)
	@ls dist/wavecomb-*.whl

sdist: build/.setup ## Build the source distribution in dist/
	@rm -f dist/wavecomb-*.tar.gz
	@$(VENV)/python -c 'from scikit_build_core.build import build_sdist; build_sdist("dist")' > /dev/null
	@ls dist/wavecomb-*.tar.gz

# Building and testing take half an hour, so a changelog without the version is reported first.
check-release: build/.setup
	@$(VENV)/python tools/release --source

# make release prints the files to upload, but uploads nothing.
release: check-release test-wheel test-sdist ## Build and test wheels and source distribution, and print what to upload
	@$(VENV)/python -c 'import twine' 2> /dev/null || $(VENV)/python -m pip install -q -c constraints.txt 'twine>=6'
	@$(VENV)/python tools/release

# ---- use ---------------------------------------------------------------------------------------

# Render the image of the README. The image is noisier without the denoiser, which is optional and
# not available on every machine.
denoiser = $(VENV)/python -c 'import pyoidn' 2> /dev/null
render: build ## Render the Mixed scene to out/mixed.exr and out/mixed.png
	@mkdir -p out
	@{ $(denoiser) || tools/wheels 'pyoidn>=2.5' || true; } & \
	  test -e out/mixed.usdc || $(VENV)/wavecomb scene mixed -o out/mixed.usdc; wait
	$(VENV)/wavecomb render out/mixed.usdc -o out/mixed.exr --png out/mixed.png --size 800 500 $$($(denoiser) && echo --denoise)

# make test does not build the documentation site, since MkDocs is an optional dependency.
docs: build build/.setup-docs ## Build the documentation site in out/site
	@$(VENV)/python -c 'import material' 2> /dev/null || $(VENV)/python -m pip install -q -c constraints.txt 'mkdocs-material>=9.5'
	NO_MKDOCS_2_WARNING=1 $(VENV)/python -m mkdocs build --strict --quiet
	@command -v doxygen > /dev/null || echo "docs: without the C++ reference, since Doxygen is missing; install it with your package manager"
	@echo "wrote out/site/index.html"

# ---- tests -------------------------------------------------------------------------------------

# tests/parts.txt lists the parts with their requirements, lanes and time budgets. make test runs
# all parts even after a failure, so that a formatting error in the source code does not hide
# failing tests.
test: ## Lint, C++ tests, sanitizers, pytest with a representative of each kind of long test
	@python3 tools/run_parts $@

test-fast: ## Lint, C++ tests, pytest without slow tests
	@python3 tools/run_parts $@

test-long: ## All tests with 10^6 samples, 500 random scenes, 100 kills, all sanitizers (over an hour)
	@python3 tools/run_parts $@

# Run the C++ tests in an optimised build, except the tests that only sanitizers make useful.
# test-asan runs these (tests/cpp/CMakeLists.txt).
test-cpp: build build/.setup-test ## C++ tests of values, lanes and whole renders
	@$(LOCK) $(VENV)/cmake --build $(BUILD) --target wavecomb_tests -j $(JOBS) -- --quiet
	$(VENV)/ctest --test-dir $(BUILD) -j $(JOBS) --verbose --output-on-failure --no-tests=error

# `make test-asan CHECKS=all` builds all C++ tests and kernels, with line numbers in
# AddressSanitizer's reports. Compiling them takes five times as long as with `CHECKS=ON`.
ASAN_DEBUG = $(if $(filter all,$(CHECKS)),-g1,-g0)
test-asan: build/.setup-test ## C++ tests of memory and whole renders under AddressSanitizer and UndefinedBehaviorSanitizer
	@test -e $(ASAN)/build.ninja || $(ASAN_LOCK) $(VENV)/cmake -S . -B $(ASAN) -G Ninja --log-level=NOTICE \
	  -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-Og $(ASAN_DEBUG)" -DWAVECOMB_SANITIZE=$(CHECKS) -DWAVECOMB_TESTS=$(CHECKS) \
	  -DWAVECOMB_BATCH=ON
	@$(ASAN_LOCK) $(VENV)/cmake --build $(ASAN) --target wavecomb_tests -j $(JOBS) -- --quiet
	$(VENV)/ctest --test-dir $(ASAN) -j $(JOBS) --verbose --output-on-failure --no-tests=error

test-asan-all:
	@$(MAKE) --no-print-directory test-asan CHECKS=all

test-tsan: build/.setup-test ## C++ tests under ThreadSanitizer
	@test -e $(TSAN)/build.ninja || $(LOCK) $(VENV)/cmake -S . -B $(TSAN) -G Ninja --log-level=NOTICE \
	  -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DWAVECOMB_SANITIZE=thread -DWAVECOMB_TESTS=all
	@$(LOCK) $(VENV)/cmake --build $(TSAN) --target wavecomb_tests -j $(JOBS) -- --quiet
	TSAN_OPTIONS="suppressions=$(CURDIR)/tests/cpp/tsan.supp $(TSAN_OPTIONS)" \
	  $(TSAN)/tests/cpp/wavecomb_tests --gtest_brief=1 $(if $(FILTER),--gtest_filter='$(FILTER)')

# Build the naive integrator, which is a reference for statistical tests, and the program that
# writes .nvdb files.
build-test-tools: build
	@$(LOCK) $(VENV)/cmake --build $(BUILD) --target wavecomb_test_tools -j $(JOBS) -- --quiet

test-py: build-test-tools build/.setup-test ## Python and statistical tests
	@$(MAKE) --no-print-directory run-py

# The run-* targets have no prerequisites, since make test builds all programs before it runs these
# targets.
run-py:
	$(VENV)/python -m pytest -q -n $(JOBS)

run-py-fast:
	$(VENV)/python -m pytest -q -n $(JOBS) -m "not slow"

run-py-long:
	WAVECOMB_LONG=1 $(VENV)/python -m pytest -q -n $(JOBS) -o faulthandler_timeout=7200

# make test-long builds all lane widths. At its end, it builds the previously configured lane widths
# again.
build-all-lanes:
	@mkdir -p build; test -e build/.lanes-before || echo "$(LANES)" > build/.lanes-before
	@$(MAKE) --no-print-directory build LANES=all

build-lanes-before:
	@$(MAKE) --no-print-directory build LANES=$$(cat build/.lanes-before 2> /dev/null || echo "$(LANES)"); rm -f build/.lanes-before

# Build and run all C++ tests, with 10^6 samples in each statistical test.
test-cpp-long: build build/.setup-test
	@trap '$(LOCK) $(VENV)/cmake -S . -B $(BUILD) --log-level=NOTICE -DWAVECOMB_TESTS=ON' EXIT; \
	  $(LOCK) $(VENV)/cmake -S . -B $(BUILD) --log-level=NOTICE -DWAVECOMB_TESTS=all; \
	  $(LOCK) $(VENV)/cmake --build $(BUILD) --target wavecomb_tests -j $(JOBS) -- --quiet; \
	  WAVECOMB_LONG=1 $(VENV)/ctest --test-dir $(BUILD) -j $(JOBS) --verbose --output-on-failure --no-tests=error

# tests/packaging/test_empty_root.py runs the wheel in a file system without a compiler.
test-wheel: wheels ## Install the wheel into a fresh environment and an empty root; render with each library
	@rm -rf $(WHEEL)/venv && $(VENV)/python -m venv $(WHEEL)/venv
	@$(WHEEL)/venv/bin/python -m pip install -q -c constraints.txt pip pytest dist/wavecomb-*.whl
	$(WHEEL)/venv/bin/python -m pytest -q -o faulthandler_timeout=3600 tests/python/test_isa.py tests/python/test_cli.py tests/packaging/test_wheel.py \
	  tests/packaging/test_empty_root.py

test-sdist: sdist build build/.setup-test ## Build the source distribution in a separate folder, and render
	$(VENV)/python -m pytest -q -o faulthandler_timeout=3600 tests/packaging/test_sdist.py

# The clang and ARM64 builds compile OpenSubdiv and GoogleTest from source, since the packages of
# the Linux distribution use GCC's standard library and the CPU of this machine.
from_source := -DOpenSubdiv_SOURCE=$(CURDIR)/.deps/source/opensubdiv -DGoogleTest_SOURCE=/usr/src/googletest
# The clang build compiles two lane widths with little optimisation, since it only tests
# correctness.
clang_widths = 1;$(if $(shell grep -m 1 -o avx2 /proc/cpuinfo 2> /dev/null),8,4)
# Path of the newest clang. make expands CLANGXX when it is used, after tools/setup has installed
# clang.
CLANGXX ?= $$(ls /usr/bin/clang++-[0-9]* | sort -V | tail -n 1)
# The oneTBB wheel uses libstdc++, and an exception from a libc++ task ends the process, so the test
# of exceptions in tasks is left out.
clang_without := RayRecording.StopsAtItsLimit
# Python tests of the clang build: they compare images with reference images from the GCC build and
# with images of the scalar integrator, and call functions of the Python API.
clang_python := test_golden test_exactness test_api test_python_policy

build/.setup-clang: build/.setup-test
	@$(SETUP_LOCK) tools/setup clang && touch $@

build/.setup-arm64: build/.setup
	@$(SETUP_LOCK) tools/setup arm64 && touch $@

# Test the module in an environment with the packages of .venv but without the editable Wavecomb of
# .venv. (Python ignores .pth files of another environment.)
test-clang: build/.setup-clang ## C++ tests and the Python module with clang and libc++, which is close to macOS
	@test -e $(CLANG)/build.ninja || $(LOCK) $(VENV)/cmake -S . -B $(CLANG) -G Ninja --log-level=NOTICE $(from_source) \
	  -DCMAKE_CXX_COMPILER="$(CLANGXX)" -DCMAKE_CXX_FLAGS=-stdlib=libc++ -DCMAKE_CXX_FLAGS_RELEASE="-O1 -DNDEBUG" \
	  -DWAVECOMB_LANE_WIDTHS="$(clang_widths)" -DWAVECOMB_BATCH=ON -DWAVECOMB_PYTHON=ON -DWAVECOMB_VDB=OFF -DWAVECOMB_TESTS=all
	@$(LOCK) $(VENV)/cmake --build $(CLANG) --target wavecomb_tests wavecomb_python -j $(JOBS) -- --quiet
	GTEST_FILTER=-$(clang_without) $(VENV)/ctest --test-dir $(CLANG) -j $(JOBS) --verbose --output-on-failure --no-tests=error
	@rm -rf $(CLANG)/venv && $(VENV)/python -m venv --without-pip $(CLANG)/venv
	@folder='import sysconfig; print(sysconfig.get_path("platlib"))'; site=$$($(CLANG)/venv/bin/python -c "$$folder"); \
	  $(VENV)/cmake --install $(CLANG) --component python --prefix "$$site" > /dev/null; cp -r python/wavecomb "$$site"; \
	  $(VENV)/python -c "$$folder" > "$$site/others.pth"
	LD_LIBRARY_PATH=$(CURDIR)/.venv/lib $(CLANG)/venv/bin/python -m pytest -q -n $(JOBS) -k "not come_out and not odd_objects" $(clang_python:%=tests/python/%.py)

# Tests of SIMD code and of whole renders, which run under ARM64 emulation. Statistical tests are
# left out, since they take hours under emulation and test formulas that do not depend on the CPU.
# Tests of containers are left out, too. ARM64_TESTS=all includes all tests.
arm64_tests := lanes rows math vec_frame warp sampler morton_hash camera_ray params programs variants surface texture curves \
  curve_clumps volumes subdivision accelerator motion wave renderer policies
# Statistical tests of materials that are left out, since each takes minutes under emulation.
arm64_without := Programs.*Furnace*:Programs.DeltaLobes*:Programs.WeightIs*:Programs.Reciprocity*:Programs.MultipleScattering*
ARM64_TESTS ?= $(subst $() ,;,$(strip $(arm64_tests)))
test-arm64: build/.setup-arm64 ## C++ tests of NEON lanes, cross-compiled for ARM64, under qemu
	@test -e $(ARM64)/build.ninja || $(LOCK) $(VENV)/cmake -S . -B $(ARM64) -G Ninja --log-level=NOTICE $(from_source) \
	  --toolchain cmake/arm64.cmake -DCMAKE_CXX_FLAGS_RELEASE="-O1 -DNDEBUG" -DWAVECOMB_ARCH=armv8-a -DWAVECOMB_BATCH=ON \
	  -DWAVECOMB_TESTS="$(ARM64_TESTS)"
	@$(LOCK) $(VENV)/cmake --build $(ARM64) --target wavecomb_tests -j $(JOBS) -- --quiet
	GTEST_FILTER='-$(arm64_without)' $(VENV)/ctest --test-dir $(ARM64) -j $(JOBS) --verbose --output-on-failure --no-tests=error

test-py-fast: build-test-tools build/.setup-test
	@$(MAKE) --no-print-directory run-py-fast

fuzz: build-test-tools build/.setup-test ## Fuzz with broken inputs for MINUTES=10; keep failing ones in out/fuzz
	nice $(VENV)/python tests/python/fuzz_stages.py --minutes $(MINUTES) --seed $(SEED) --jobs $(JOBS) --keep out/fuzz

bench: build ## Run micro-benchmarks; JSON goes to out/micro
	@$(LOCK) $(VENV)/cmake --build $(BUILD) --target wavecomb_benchmarks -j $(JOBS) -- --quiet
	@mkdir -p out/micro; for program in $(BUILD)/benchmarks/micro/micro_*; do [ -f $$program ] || continue; \
	  echo "== $$program"; $$program --benchmark_out=out/micro/$${program##*/micro_}.json || exit 1; done

# Blender's wheels are 400 MB each, so they are not part of make setup and make test.
setup-blender: ## Install Blender's Python wheels, oldest and newest supported, for test-blender
	@tools/blender_wheels

test-blender: build setup-blender ## Test the Blender extension, and compare its images with those of Cycles
	$(VENV)/python -m pytest -q -o faulthandler_timeout=3600 tests/blender

# Writes the zip that Blender installs.
blender-extension: ## Build the Blender extension dist/wavecomb-blender.zip
	@mkdir -p dist; rm -f dist/wavecomb-blender.zip
	@$(VENV)/python -m zipfile -c dist/wavecomb-blender.zip blender/*.py blender/blender_manifest.toml blender/LICENSE
	@ls dist/wavecomb-blender.zip

# ---- style -------------------------------------------------------------------------------------

lint: build/.setup-test ## Check layout, layers, sizes, English and types; changes nothing
	$(VENV)/ruff check --quiet .
	$(VENV)/ruff format --check --quiet . || { echo "lint: run make format"; exit 1; }
	$(VENV)/python tools/check_layers
	$(VENV)/python tools/check_sizes
	$(VENV)/python tools/check_words
	@printf '%s\n' $(CPP_FILES) | xargs -r -P $(JOBS) -n 24 $(VENV)/clang-format --dry-run --Werror \
	  || { echo "lint: run make format"; exit 1; }
	$(VENV)/mypy

format: build/.setup-test ## Format all sources
	$(VENV)/ruff check --quiet --fix-only .
	$(VENV)/ruff format --quiet .
	@printf '%s\n' $(CPP_FILES) | xargs -r $(VENV)/clang-format -i

clean: ## Remove build outputs (keeps .venv and .deps)
	rm -rf build out
