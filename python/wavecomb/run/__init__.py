# SPDX-License-Identifier: Apache-2.0
"""Runs renders: frame sequences, checkpoints, progress, statistics and process isolation."""
