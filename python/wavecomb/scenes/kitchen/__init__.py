# SPDX-License-Identifier: Apache-2.0
"""A kitchen with mostly glossy materials."""
