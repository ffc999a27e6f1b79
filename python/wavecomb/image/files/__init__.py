# SPDX-License-Identifier: Apache-2.0
"""Image files: formats, output of renders, and atomic writing."""
