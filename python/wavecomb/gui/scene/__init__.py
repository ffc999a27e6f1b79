# SPDX-License-Identifier: Apache-2.0
"""The stage: its tree, materials, lights, and edits of them."""
