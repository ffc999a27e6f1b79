# SPDX-License-Identifier: Apache-2.0
"""All that is read of MaterialX: files as layers in memory, nodes, surface shaders.

Nothing outside of this package imports it but ``wavecomb.usd.mtlx``.
"""
