# SPDX-License-Identifier: Apache-2.0
"""Reads MaterialX: documents as layers in memory, node graphs, and surface shaders.

Outside of this package, only ``wavecomb.usd.mtlx`` imports it.
"""
