# SPDX-License-Identifier: Apache-2.0
"""Builds groups of the scene and instances them."""
