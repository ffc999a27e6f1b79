# SPDX-License-Identifier: Apache-2.0
"""The window of `wavecomb view`. Only this package and cli/view.py import Qt."""
