# SPDX-License-Identifier: Apache-2.0
"""Benchmark reports as HTML and Markdown."""
