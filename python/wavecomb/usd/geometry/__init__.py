# SPDX-License-Identifier: Apache-2.0
"""Meshes, shapes, curves and points as arrays for the core."""
