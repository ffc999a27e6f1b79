# SPDX-License-Identifier: Apache-2.0
"""Writing of generated stages: prims, materials, textures."""
