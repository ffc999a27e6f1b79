# SPDX-License-Identifier: Apache-2.0
"""The window, `wavecomb view`. Nothing outside this package and cli/view.py imports Qt."""
