# SPDX-License-Identifier: Apache-2.0
"""Statistical analysis of benchmark results."""
