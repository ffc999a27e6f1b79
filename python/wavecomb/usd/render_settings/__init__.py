# SPDX-License-Identifier: Apache-2.0
"""Reads render settings and products of a stage."""
