# SPDX-License-Identifier: Apache-2.0
"""The window of `wavecomb view`. Only the package wavecomb.gui and cli/view.py import Qt."""
