# SPDX-License-Identifier: Apache-2.0
"""Scene panels: the stage's prim tree, materials and lights, and the edits of them."""
