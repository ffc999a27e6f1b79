# SPDX-License-Identifier: Apache-2.0
"""Reads UsdLux lights, light filters and IES profiles."""
