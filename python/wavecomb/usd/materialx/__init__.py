# SPDX-License-Identifier: Apache-2.0
"""Reads MaterialX: documents as layers in memory, node graphs, and surface shaders.

Only ``wavecomb.usd.mtlx`` imports this package from outside.
"""
