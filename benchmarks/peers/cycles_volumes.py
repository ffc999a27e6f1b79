# SPDX-License-Identifier: Apache-2.0
"""Convert volumes to Cycles. Grids are read from .vdb files; other volumes become boxes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from cycles_nodes import Images, Nodes


def make_volume(volume: dict[str, Any], folder: Path, images: Images) -> Any:
    """Make the data of a Blender object, whose transform is the volume's ``to_world``."""
    if volume.get("color") is not None or any(volume.get("emission", (0.0,))):
        raise NotImplementedError("volumes with emission or a colour grid")
    if volume.get("density") is None:
        low, high = (np.array(end, np.float64) for end in volume["bounds"])
        corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        data = bpy.data.meshes.new("volume")
        data.from_pydata([tuple(low + np.array(c) * (high - low)) for c in corners], [], faces)
    else:
        data = bpy.data.volumes.new("volume")
        data.filepath = str((folder / volume["file"]).resolve())
    data.materials.append(_material(volume, images))
    return data


def _material(volume: dict[str, Any], images: Images) -> Any:
    made = bpy.data.materials.new("volume")
    made.use_nodes = True
    nodes = Nodes(made.node_tree, images)
    extinction = np.asarray(volume["extinction"], np.float64)
    albedo = np.asarray(volume["albedo"], np.float64)
    density = None
    if volume.get("density") is not None:
        attribute = nodes.add("ShaderNodeAttribute")
        attribute.attribute_name = "density"
        density = attribute.outputs["Fac"]

    def coefficient(value: Any) -> Any:
        rgb = tuple(float(v) for v in value)
        return rgb if density is None else nodes.vector("MULTIPLY", density, rgb)

    node = nodes.tree.nodes.new("ShaderNodeVolumeCoefficients")
    node.phase = "HENYEY_GREENSTEIN"
    node.inputs["Anisotropy"].default_value = float(volume.get("anisotropy", 0.0))
    for name, value in (
        ("Absorption Coefficients", extinction * (1.0 - albedo)),
        ("Scatter Coefficients", extinction * albedo),
    ):
        socket = coefficient(value)
        if isinstance(socket, bpy.types.NodeSocket):
            nodes.tree.links.new(socket, node.inputs[name])
        else:
            node.inputs[name].default_value = socket
    nodes.out("ShaderNodeOutputMaterial", node.outputs[0], "Volume")
    return made
