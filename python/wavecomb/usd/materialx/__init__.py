# SPDX-License-Identifier: Apache-2.0
"""Reads MaterialX documents as layers in memory, with their node graphs and surface shaders.

Other packages use this package only through ``wavecomb.usd.mtlx``.
"""
