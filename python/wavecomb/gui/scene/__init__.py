# SPDX-License-Identifier: Apache-2.0
"""Scene panels: prim tree, materials and lights of the stage, and their edits."""
