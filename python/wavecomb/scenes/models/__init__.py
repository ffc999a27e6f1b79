# SPDX-License-Identifier: Apache-2.0
"""Meshes of the generated stages: primitive shapes, the teapot, the dragon, mesh files."""
