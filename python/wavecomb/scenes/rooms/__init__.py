# SPDX-License-Identifier: Apache-2.0
"""Rooms among the generated stages: a dining room and a kitchen."""
