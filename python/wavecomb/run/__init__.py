# SPDX-License-Identifier: Apache-2.0
"""Renders from start to end: sequences, checkpoints, progress, statistics, isolation."""
