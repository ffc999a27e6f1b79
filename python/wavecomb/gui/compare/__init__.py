# SPDX-License-Identifier: Apache-2.0
"""The window that compares two images."""
