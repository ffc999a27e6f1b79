# SPDX-License-Identifier: Apache-2.0
"""Materials: converts shader networks to programs, parameters, textures and value graphs."""
