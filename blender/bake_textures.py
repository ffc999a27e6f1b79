# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes sockets of materials to images; runs in a separate Blender (see ``textures``)."""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import bpy
import numpy as np

LAYER = "wavecombBake"
SAMPLES = 4


def main(job_file: str) -> None:
    """Unwraps the objects of a job into one atlas, and bakes its requests."""
    with open(job_file, encoding="utf-8") as stream:
        job = json.load(stream)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(job["blend"]) as (_, wanted):
        wanted.objects = list(job["objects"])
    scene = bpy.context.scene
    scene.frame_set(int(job["time"]), subframe=job["time"] - int(job["time"]))
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    things = [bpy.data.objects[name] for name in job["objects"]]
    for thing in things:
        scene.collection.objects.link(thing)
        thing.select_set(True)
    bpy.context.view_layer.objects.active = things[0]
    _unwrap(things)
    _write_coordinates(things, job["coordinates"])
    materials = {
        s.material.name: s.material for t in things for s in t.material_slots if s.material
    }
    nothing = bpy.data.images.new("nothing", 8, 8)
    for material in materials.values():
        _receive(material, nothing)
    for request in job["requests"]:
        _bake(materials[request["material"]], request, job["size"], nothing)


def _unwrap(things: list[Any]) -> None:
    """Gives all objects coordinates without overlap; their materials still use their own."""
    for thing in things:
        layers = thing.data.uv_layers
        used = next((layer.name for layer in layers if layer.active_render), None)
        layers.active = layers.new(name=LAYER, do_init=False)
        layers[used or LAYER].active_render = True
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.reveal(select=True)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=0.01)
    bpy.ops.object.mode_set(mode="OBJECT")


def _write_coordinates(things: list[Any], file: str) -> None:
    found: dict[str, Any] = {}
    for i, thing in enumerate(things):
        layer = thing.data.uv_layers[LAYER]
        values = np.empty(2 * len(thing.data.loops), np.float32)
        layer.uv.foreach_get("vector", values)
        found[str(i)] = values.reshape(-1, 2)
    with open(file + ".part", "wb") as stream:
        np.savez(stream, **found)
    os.replace(file + ".part", file)


def _receive(material: Any, image: Any) -> Any:
    """Makes an image the target of bakes of a material; returns its node."""
    material.use_nodes = True
    tree = material.node_tree
    node = tree.nodes.get("wavecombTarget") or tree.nodes.new("ShaderNodeTexImage")
    node.name, node.image = "wavecombTarget", image
    for one in tree.nodes:
        one.select = False
    node.select = True
    tree.nodes.active = node
    return node


def _bake(material: Any, request: dict[str, Any], size: int, nothing: Any) -> None:
    """Bakes one output socket as emission."""
    tree = material.node_tree
    source = tree.nodes[request["node"]]
    socket = next(s for s in source.outputs if s.identifier == request["socket"])
    if request["kind"] == "height":
        socket = _bump_of(tree, source)
    if request["kind"] != "value":
        socket = _encoded(tree, socket)
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(socket, emission.inputs["Color"])
    output = tree.get_output_node("CYCLES")
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    for link in list(output.inputs["Displacement"].links):
        tree.links.remove(link)
    image = bpy.data.images.new("baked", size, size, alpha=False, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    _receive(material, image)
    bpy.ops.object.bake(type="EMIT", margin=16, use_clear=True)
    image.file_format = "OPEN_EXR"
    image.save(filepath=request["file"] + ".part.exr")
    os.replace(request["file"] + ".part.exr", request["file"])
    _receive(material, nothing)


def _bump_of(tree: Any, displacement: Any) -> Any:
    """Returns the normal that a displacement node gives as a bump."""
    bump = tree.nodes.new("ShaderNodeBump")
    for name, target in (("Height", "Height"), ("Scale", "Distance")):
        from_socket = displacement.inputs[name]
        bump.inputs[target].default_value = from_socket.default_value
        if from_socket.links:
            tree.links.new(from_socket.links[0].from_socket, bump.inputs[target])
    return bump.outputs[0]


def _encoded(tree: Any, normal: Any) -> Any:
    """Returns a normal in object space, from 0 to 1."""
    turn = tree.nodes.new("ShaderNodeVectorTransform")
    turn.vector_type, turn.convert_from, turn.convert_to = "NORMAL", "WORLD", "OBJECT"
    tree.links.new(normal, turn.inputs[0])
    scale = tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value = scale.inputs[2].default_value = (0.5, 0.5, 0.5)
    tree.links.new(turn.outputs[0], scale.inputs[0])
    return scale.outputs[0]


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1])
