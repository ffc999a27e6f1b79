# SPDX-License-Identifier: Apache-2.0
"""Benchmark suites: reading, running, recording and analysing them (docs/bench.md)."""
