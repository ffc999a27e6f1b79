# SPDX-License-Identifier: Apache-2.0
"""Opens USD stages and reads them into scenes."""
