# SPDX-License-Identifier: Apache-2.0
"""Image files, layers, colour, comparison, denoising and merging."""
