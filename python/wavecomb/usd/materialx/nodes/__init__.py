# SPDX-License-Identifier: Apache-2.0
"""Compiles MaterialX nodes to value graphs; nodes without a handler use the library's graphs."""
