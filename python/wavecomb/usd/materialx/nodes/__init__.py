# SPDX-License-Identifier: Apache-2.0
"""Compiles MaterialX nodes to value graphs, by handlers or through the library's node graphs."""
