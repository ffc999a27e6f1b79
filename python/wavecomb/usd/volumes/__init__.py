# SPDX-License-Identifier: Apache-2.0
"""Volumes of a stage: the prims, their fields in .vdb files, and what their materials say."""
