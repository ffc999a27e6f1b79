# SPDX-License-Identifier: Apache-2.0
"""Converts MaterialX surface shaders to the programs "openpbr" and "hair"."""
