# SPDX-License-Identifier: Apache-2.0
"""The live image: rendering, display and camera."""
