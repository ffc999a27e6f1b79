# SPDX-License-Identifier: Apache-2.0
"""Interiors among the generated stages: a dining room and a kitchen."""
