# SPDX-License-Identifier: Apache-2.0
"""MaterialX's nodes as value graphs: primitives are written here, the rest is the library's."""
