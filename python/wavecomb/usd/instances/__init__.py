# SPDX-License-Identifier: Apache-2.0
"""Builds groups of objects (the world and the prototypes) and instances them."""
