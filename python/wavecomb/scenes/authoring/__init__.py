# SPDX-License-Identifier: Apache-2.0
"""Modules that write generated stages: prims, materials and textures."""
