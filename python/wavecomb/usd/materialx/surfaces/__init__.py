# SPDX-License-Identifier: Apache-2.0
"""MaterialX's surface shaders as the program "openpbr"."""
