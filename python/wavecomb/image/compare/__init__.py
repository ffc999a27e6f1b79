# SPDX-License-Identifier: Apache-2.0
"""Comparison of images: error metrics, perceptual metrics, statistical tests, heat maps."""
