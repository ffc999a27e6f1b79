# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes the nodes of a world to an image, by Cycles in a separate process.

A render engine cannot start another render while it runs, so the world is written to a .blend file
that a second Blender opens. The image is kept as long as the world does not change.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from typing import Any

from .context import Translation

WIDTH = 2048
"""Width of the baked image, in pixels."""
LIMIT_S = 300.0


def world(into: Translation, made: Any) -> str | None:
    """Returns an equirectangular image of a world; None if it could not be baked."""
    import bpy

    original = made.original if made.is_evaluated else made
    blend = into.file("world.blend")
    bpy.data.libraries.write(blend, {original}, path_remap="ABSOLUTE", fake_user=True)
    key = f"{original.name}\n{content(original)}\n{into.time if is_animated(original) else ''}"
    name = f"world-{hashlib.sha256(key.encode()).hexdigest()[:16]}.exr"
    file = into.file(name)
    if os.path.exists(file):
        return file
    words = [blend, original.name, file, str(WIDTH), repr(into.time)]
    is_done = run_blender("bake_world.py", words)
    return file if is_done and os.path.exists(file) else None


def run_blender(script: str, words: list[str]) -> bool:
    """Runs a script of this folder in another Blender; returns whether it succeeded."""
    import bpy

    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), script)
    if bpy.app.binary_path:
        program = [bpy.app.binary_path, "-b", "--factory-startup", "--disable-autoexec"]
        command = [*program, "--python-exit-code", "1", "--python", path, "--", *words]
    else:
        command = [sys.executable, "-I", path, "--", *words]
    try:
        done = subprocess.run(command, capture_output=True, timeout=LIMIT_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    if done.returncode != 0:
        print("wavecomb: bake:", done.stderr.decode(errors="replace")[-2000:], flush=True)
    return done.returncode == 0


def is_animated(made: Any) -> bool:
    """Returns whether a world or material, or its nodes, have keyframes or drivers."""
    tree = made.node_tree
    return made.animation_data is not None or bool(tree and tree.animation_data)


def content(made: Any) -> str:
    """Returns a text that describes all nodes and values of a node tree."""
    lines: list[str] = []
    _describe(made.node_tree, lines)
    return "\n".join(lines)


def _describe(tree: Any, lines: list[str]) -> None:
    for node in tree.nodes:
        lines.append(f"{node.bl_idname} {node.name} {node.mute}")
        for name, prop in node.bl_rna.properties.items():
            if prop.type in {"BOOLEAN", "INT", "FLOAT", "ENUM", "STRING"} and name != "select":
                own = getattr(node, name)
                is_list = hasattr(own, "__len__") and prop.type != "STRING"
                lines.append(f"{name} {list(own) if is_list else own!r}")
        for socket in (*node.inputs, *node.outputs):
            value: Any = getattr(socket, "default_value", None)
            lines.append(repr(list(value) if hasattr(value, "__len__") else value))
        image = getattr(node, "image", None)
        if image is not None:
            lines.append(f"{image.filepath} {image.session_uid}")
        ramp = getattr(node, "color_ramp", None)
        for stop in ramp.elements if ramp is not None else ():
            lines.append(f"{stop.position} {list(stop.color)}")
        if getattr(node, "node_tree", None) is not None:
            _describe(node.node_tree, lines)
    lines.extend(
        f"{link.from_node.name} {link.from_socket.identifier} {link.to_node.name} "
        f"{link.to_socket.identifier}"
        for link in tree.links
    )
