# SPDX-License-Identifier: Apache-2.0
"""Reads volumes of a stage: prims, fields in .vdb files, and volume materials."""
