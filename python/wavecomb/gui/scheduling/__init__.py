# SPDX-License-Identifier: Apache-2.0
"""Panels for scheduling settings and for measuring their effect."""
