# SPDX-License-Identifier: Apache-2.0
"""Materials: networks of shaders to programs, parameters, textures and value graphs."""
