# SPDX-License-Identifier: Apache-2.0
"""Panels, bars and dialogs around the image."""
