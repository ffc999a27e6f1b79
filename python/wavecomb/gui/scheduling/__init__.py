# SPDX-License-Identifier: Apache-2.0
"""Policies and what they are worth."""
