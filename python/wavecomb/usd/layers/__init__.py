# SPDX-License-Identifier: Apache-2.0
"""Opens layers and stages, and lists the files that they need."""
