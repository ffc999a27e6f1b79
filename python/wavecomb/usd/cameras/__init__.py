# SPDX-License-Identifier: Apache-2.0
"""Reads USD cameras: projection, framing, lens and motion."""
