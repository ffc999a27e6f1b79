# SPDX-License-Identifier: Apache-2.0
"""MaterialX files as layers in memory."""
