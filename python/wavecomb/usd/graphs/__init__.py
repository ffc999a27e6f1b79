# SPDX-License-Identifier: Apache-2.0
"""Value graphs: typed shading expressions that are compiled to programs of the core.

The module ``values`` defines and compiles values, ``surface_parameters`` assigns them to parameters
of surfaces, and ``binding`` adapts them to a mesh.
"""
