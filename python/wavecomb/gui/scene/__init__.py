# SPDX-License-Identifier: Apache-2.0
"""Panels for the stage: its tree, materials and lights, and their edits."""
