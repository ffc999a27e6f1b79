# SPDX-License-Identifier: Apache-2.0
"""The benchmark suite: what is run, how it is run, and what is kept. docs/bench.md tells it."""
