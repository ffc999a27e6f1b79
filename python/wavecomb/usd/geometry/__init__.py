# SPDX-License-Identifier: Apache-2.0
"""Reads meshes, implicit shapes, curves, points and splats as arrays for the core."""
