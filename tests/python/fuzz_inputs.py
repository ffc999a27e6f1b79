# SPDX-License-Identifier: Apache-2.0
"""Broken inputs other than stages and images.

The inputs are IES profiles, MaterialX, meshes, files that renders write, and names of image files.
Each case is made from a valid file by the mutations of ``fuzz_cases``. ``fuzz_worker`` and the
command choose the reader of a case by the file name.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import random
import re
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import nvdb

from wavecomb import vdb

Mutation = Callable[[random.Random, bytes], bytes]

BALL = """#usda 1.0
def Mesh "Quad" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
}
def DomeLight "Sky" {}
"""
LAMP = """#usda 1.0
def Mesh "Floor" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)]
}
def RectLight "Lamp" ( prepend apiSchemas = ["ShapingAPI"] ) {
    asset inputs:shaping:ies:file = @lamp.ies@
    float inputs:shaping:ies:angleScale = 0.5
    bool inputs:shaping:ies:normalize = 1
    double3 xformOp:translate = (0, 2, 0)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
"""
IES = """IESNA:LM-63-2002
[TEST] 1
[MANUFAC] nobody
TILT=INCLUDE
1
2
0 90
1 0.9
1 1000 2.5 5 4 1 2 0.1 0.2 0
1 1 10
0 22.5 45 67.5 90
0 30 60 90
10 9 7 4 0
11 8 6 4 0
10 9 7 3 0
12 9 7 4 1
"""
MATERIALX_STAGE = """#usda 1.0
def Xform "Looks" ( references = @looks.mtlx@</MaterialX> ) {}
def Sphere "Ball" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
    rel material:binding = </Looks/Materials/Paint>
}
def DomeLight "Sky" {}
"""
MATERIALX = """<?xml version="1.0"?>
<materialx version="1.39" colorspace="lin_rec709">
  <xi:include href="more.mtlx" xmlns:xi="http://www.w3.org/2001/XInclude"/>
  <nodegraph name="NG">
    <input name="tint" type="color3" value="0.8, 0.4, 0.2"/>
    <texcoord name="uv" type="vector2"/>
    <image name="img" type="color3">
      <input name="file" type="filename" value="a.png"/>
      <input name="texcoord" type="vector2" nodename="uv"/>
    </image>
    <multiply name="mul" type="color3">
      <input name="in1" type="color3" nodename="img"/>
      <input name="in2" type="color3" interfacename="tint"/>
    </multiply>
    <noise3d name="noise" type="float"><input name="amplitude" type="float" value="0.5"/></noise3d>
    <output name="out" type="color3" nodename="mul"/>
    <output name="rough" type="float" nodename="noise"/>
  </nodegraph>
  <open_pbr_surface name="SR" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG" output="out"/>
    <input name="specular_roughness" type="float" nodegraph="NG" output="rough"/>
    <input name="emission_luminance" type="float" value="0.1"/>
  </open_pbr_surface>
  <surfacematerial name="Paint" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR"/>
  </surfacematerial>
  <look name="L"><materialassign name="a" material="Paint" geom="/*" collection="C"/></look>
  <collection name="C" includegeom="/Ball"/>
</materialx>
"""
MORE = '<?xml version="1.0"?>\n<materialx version="1.39"></materialx>\n'
OBJ = """# a box without a lid
mtllib none.mtl
v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
o box
g side
s off
f 4/1/1 3/2/1 2/3/1 1/1/1
f 5 6 7 8
f 1/1 2/2 6/3
f -8 -3 -4
f 2//1 3//1 7//1 6//1
f 4 1 5 8
"""
PLY_HEAD = """ply
format {form} 1.0
comment a pyramid
element vertex 5
property float x
property float y
property double z
property uchar red
element face 5
property list uchar int vertex_indices
end_header
"""
PLY_POINTS = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1.5)]
PLY_FACES = [(3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
PRODUCT = """#usda 1.0
(
    renderSettingsPrimPath = "/Render/Settings"
)
def Sphere "Ball" {
}
def Camera "Cam" {
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Scope "Render" {
    def RenderSettings "Settings" {
        rel camera = </Cam>
        int2 resolution = (8, 8)
        rel products = [</Render/A>, </Render/B>]
    }
    def RenderProduct "A" {
        token productName = NAME
        rel orderedVars = </Render/Color>
    }
    def RenderProduct "B" {
        token productName = "b.exr"
        rel orderedVars = </Render/Color>
    }
    def RenderVar "Color" {
        string sourceName = "Ci"
    }
}
"""


@cache
def ply_bytes(form: str) -> bytes:
    """Returns a small mesh in one of the three PLY formats."""
    import struct

    head = PLY_HEAD.format(form=form).encode()
    if form == "ascii":
        lines = [f"{x} {y} {z} 200" for x, y, z in PLY_POINTS]
        lines += [f"{len(face)} {' '.join(map(str, face))}" for face in PLY_FACES]
        return head + ("\n".join(lines) + "\n").encode()
    order = "<" if "little" in form else ">"
    body = b"".join(struct.pack(order + "ffdB", x, y, z, 200) for x, y, z in PLY_POINTS)
    for face in PLY_FACES:
        body += struct.pack(f"{order}B{len(face)}i", len(face), *face)
    return head + body


@cache
def left_over(what: str) -> bytes:
    """Returns a file that a render of ``BALL`` writes. "exr" has seed 1 and "exr2" seed 2."""
    import wavecomb
    from wavecomb.run.cost_profile import save_costs

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stage = folder / "stage.usda"
        stage.write_text(BALL)
        if what == "ckpt":
            wavecomb.render(stage, size=(8, 8), spp=2, threads=1, checkpoint=folder / "a.ckpt")
            return (folder / "a.ckpt").read_bytes()
        if what == "json":
            picture = wavecomb.render(stage, size=(8, 8), spp=1, threads=1)
            save_costs(folder / "costs.json", picture.costs)
            return (folder / "costs.json").read_bytes()
        import subprocess
        import sys

        out = folder / "a.exr"
        words = ["render", stage, "-o", out, "--size", 8, 8, "--spp", 2, "--quiet"]
        words += ["--seed", 2 if what == "exr2" else 1, "--aov", "samples"]
        words += ["--aov", "error", "--aov", "crypto"]
        command = [sys.executable, "-m", "wavecomb", *map(str, words)]
        subprocess.run(command, check=True, cwd=folder)
        return out.read_bytes()


VOLUME = """#usda 1.0
def Volume "Smoke" {
    rel field:density = </Smoke/density>
    rel field:heat = </Smoke/heat>
    def OpenVDBAsset "density" { asset filePath = @a.vdb@
}
    def OpenVDBAsset "heat" { asset filePath = @a.vdb@
}
    rel material:binding = </Look>
}
def Material "Look" {
    token outputs:volume.connect = </Look/Shader.outputs:out>
    def Shader "Shader" {
        uniform token info:id = "standard_volume"
        string inputs:temperature_channel = "heat"
        token outputs:out
    }
}
"""


@cache
def vdb_bytes(name: str = "a.vdb", packed: str = "none", bits: str = "32") -> bytes:
    """Returns two small grids, one of which has a tile."""
    import numpy as np

    rng = np.random.default_rng(1)
    values = rng.random((4, 8, 8, 8), np.float32)
    values[values < 0.5] = 0
    values[3] = 0.5
    bricks = {
        "origins": np.array([[0, 0, 0], [8, 0, 0], [-8, 16, 8], [64, 0, 0]], np.int32),
        "index_to_object": np.diag([0.1, 0.1, 0.1, 1.0]), "tiles": True,
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, name)
        halves = values.astype(np.float16)
        made = [{"name": "density", "values": values, "bits": bits, **bricks},
                {"name": "heat", "values": halves, **bricks}]  # fmt: skip
        if name.endswith(".nvdb"):
            nvdb.write(file, made, packed)
        else:
            vdb.write(file, made)
        return file.read_bytes()


def _nvdb(rng: random.Random, mutate: Mutation) -> bytes:
    """Returns a .nvdb file with mutations anywhere, only in its headers, or only at nonzero words.

    Most of a .nvdb file is zeros that are not read.
    """
    packed, bits = rng.choice(("none", "none", "zip", "blosc")), rng.choice(("32", "8", "n"))
    data = vdb_bytes("a.nvdb", packed, bits)
    how = rng.random()
    if how < 0.3:
        return mutate(rng, data)
    if how < 0.5:
        return mutate(rng, data[:1600]) + data[1600:]
    made = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 6))):
        at = 8 * rng.randrange(len(made) // 8)
        while not any(made[at : at + 8]):
            at = (at + 8) % (len(made) // 8 * 8)
        word = int.from_bytes(made[at : at + 8], "little")
        new = rng.choice((0, 1, word + 32, word - 32, word ^ 1 << rng.randrange(64), 2**31 - 1,
                          2**63, 2**64 - 1, len(made), rng.getrandbits(64)))  # fmt: skip
        made[at : at + 8] = (new % 2**64).to_bytes(8, "little")
    return bytes(made)


_WORDS = re.compile(rb"[^\s<>=\"/,:{}\[\]]+")
STRANGE = (
    b"-1", b"0", b"4294967296", b"99999999999999999999", b"1e999", b"nan", b"", b"\xff\xfe",
    b"../../x", b"/etc/passwd", b"1,2,3", b"true", b"null", b"{" * 3000, b"[" * 3000, b"x" * 9000,
    b"&lt;", b"<a>" * 2000,
)  # fmt: skip


def swap_words(rng: random.Random, data: bytes) -> bytes:
    """Replaces words of a text by other words of the text, or by unusual ones."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        found = list(_WORDS.finditer(data))
        if not found:
            return data
        match = rng.choice(found)
        new = rng.choice(STRANGE) if rng.random() < 0.6 else rng.choice(found).group()
        data = data[: match.start()] + new + data[match.end() :]
    return data


def _checkpoint(rng: random.Random, mutate: Mutation) -> bytes:
    """Returns a checkpoint that is broken as an archive, or in one of its members."""
    data = left_over("ckpt")
    if rng.random() < 0.5:
        return mutate(rng, data)
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        victim, packed = rng.choice(old.namelist()), rng.random() < 0.1
        for name in old.namelist():
            member = old.read(name)
            broken = rng.choice((mutate, swap_words))(rng, member) if name == victim else member
            new.writestr(name, broken, zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED)
    return out.getvalue()


def _costs(rng: random.Random) -> bytes:
    data = left_over("json")
    if rng.random() < 0.2:
        deep = json.loads(data)
        nested: object = 1
        for _ in range(rng.choice((10, 500))):
            nested = [nested] if rng.random() < 0.5 else {"a": nested}
        deep[rng.choice(("materials", "textures", "schema"))] = nested
        return json.dumps(deep).encode()
    return swap_words(rng, data)


def _names(folder: Path) -> tuple[str, ...]:
    """Returns names of image files, many of which point outside of the folder."""
    outside = folder.parent / "outside.exr"
    return (
        "a.exr", "sub/a.exr", "../outside.exr", "../../outside.exr", str(outside), "link/a.exr",
        "sub/../../outside.exr", "./a.exr", "a.exr/b.exr", "", ".", "..", "/", "~/outside.exr",
        "link", "a\\n.exr", "b.exr", "stage.usda", "a.txt", "a", "$HOME/a.exr", "a.<F4>.exr",
        "file:///tmp/wavecomb-outside.exr", "x" * 300 + ".exr", "link/../a.exr", "loop/a.exr",
    )  # fmt: skip


def make_input(kind: str, rng: random.Random, folder: Path, mutations: list[Mutation]) -> Path:
    """Writes the files of a case. Returns the file to read."""
    mutate = rng.choice([*mutations, swap_words])
    stage = folder / "stage.usda"
    if kind == "ies":
        (folder / "lamp.ies").write_bytes(mutate(rng, IES.encode()))
        stage.write_text(LAMP)
        return stage
    if kind == "mtlx":
        data, more = MATERIALX.encode(), MORE.encode()
        how = rng.random()
        (folder / "looks.mtlx").write_bytes(mutate(rng, data) if how < 0.9 else data)
        include = '<xi:include href="looks.mtlx"/></materialx>'
        more = MORE.replace("</materialx>", include).encode() if how >= 0.9 else more
        (folder / "more.mtlx").write_bytes(mutate(rng, more) if how < 0.2 else more)
        stage.write_text(MATERIALX_STAGE)
        return stage
    if kind == "vdb":
        (folder / "a.vdb").write_bytes(mutate(rng, vdb_bytes()))
        stage.write_text(VOLUME)
        return stage
    if kind == "nvdb":
        (folder / "a.nvdb").write_bytes(_nvdb(rng, mutate))
        stage.write_text(VOLUME.replace("a.vdb", "a.nvdb"))
        return stage
    if kind in ("ply", "obj"):
        form = rng.choice(("ascii", "binary_little_endian", "binary_big_endian"))
        data = mutate(rng, ply_bytes(form) if kind == "ply" else OBJ.encode())
        packed = rng.random() < 0.15
        file = folder / f"mesh.{kind}{'.gz' if packed else ''}"
        if packed:
            data = gzip.compress(data)
            data = mutate(rng, data) if rng.random() < 0.5 else data
        file.write_bytes(data)
        return file
    stage.write_text(BALL)
    if kind == "checkpoint":
        file = folder / "case.ckpt"
        file.write_bytes(_checkpoint(rng, mutate))
    elif kind == "merge":
        file = folder / "case.exr"
        file.write_bytes(mutate(rng, left_over("exr")))
        (folder / "good.exr").write_bytes(left_over("exr2"))
    elif kind == "costs":
        file = folder / "case.json"
        file.write_bytes(mutate(rng, left_over("json")) if rng.random() < 0.3 else _costs(rng))
    else:
        (folder / "sub").mkdir()
        os.symlink(folder.parent, folder / "link")
        os.symlink("loop", folder / "loop")
        name = rng.choice(_names(folder))
        stage.write_text(PRODUCT.replace("NAME", json.dumps(name)))
        return stage
    return file


INPUTS = (
    "ies", "mtlx", "ply", "obj", "checkpoint", "merge", "costs", "product names",
    *(("vdb",) if vdb.is_there() else ()),
    *(("nvdb",) if vdb.nano_version() and nvdb.writer() else ()),
)  # fmt: skip
BY_COMMAND = ("product names",)
"""Kinds of inputs that only the command can check, because it writes the files."""


def words_for(case: Path) -> list[str]:
    """Returns arguments of ``wavecomb`` that make it read a case. Output goes to ``-o``."""
    out, stage = str(case.with_name("out.exr")), str(case.with_name("stage.usda"))
    small = ["--size", "8", "8", "--spp", "1", "--quiet"]
    if case.name.startswith("mesh."):
        out = str(case.with_name("out.usda"))
        return ["scene", "cornell-dragon", "-o", out, "--dragon", str(case)]
    if case.name == "case.ckpt":
        return ["render", stage, "-o", out, "--resume", str(case), "--quiet"]
    if case.name == "case.exr":
        return ["merge", str(case), str(case.with_name("good.exr")), "-o", out]
    if case.name == "case.json":
        return ["render", stage, "-o", out, *small, "--policy", "adaptive", "--costs", str(case)]
    return ["render", str(case), "-o", out, *small]
