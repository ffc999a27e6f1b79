# SPDX-License-Identifier: Apache-2.0
"""Image files: reading, formats, writing of renders, and atomic replacement."""
