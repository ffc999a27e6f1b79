# SPDX-License-Identifier: Apache-2.0
"""Converts shader networks to surfaces: programs, parameters, textures and value graphs."""
