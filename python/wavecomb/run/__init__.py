# SPDX-License-Identifier: Apache-2.0
"""Runs renders: sequences of frames, checkpoints, progress, statistics, isolation."""
