# SPDX-License-Identifier: Apache-2.0
"""Value graphs: typed expressions that are folded, shared and compiled to flat programs.

``values`` defines values and compiles them, ``surface_parameters`` maps them to surface parameters,
and ``binding`` specialises them for one mesh.
"""
