# SPDX-License-Identifier: Apache-2.0
"""Pictures: files, layers, colour, comparison, denoising, merging."""
