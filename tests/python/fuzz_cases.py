# SPDX-License-Identifier: Apache-2.0
"""Broken stages and images. Each case is determined by its kind, a seed and a number."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable
from pathlib import Path

from fuzz_graphs import GRAPHS
from fuzz_inputs import INPUTS, make_input
from fuzz_seeds import IMAGES, OTHER, image_bytes, stage_bytes, stage_text

Mutation = Callable[[random.Random, bytes], bytes]

HUGE = (
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    1 << 40,
    (1 << 63) - 1,
    (1 << 64) - 1,
)
NUMBERS = (
    "-1", "0", "7", "65536", "2147483647", "-2147483648", "4294967296", "99999999999999999999",
    "1e30", "-1e300", "nan", "inf", "-inf", "1e-40", '"text"', "(1, 2)", "[]", "None", "</World>",
    "@gone.usd@", "true", "",
)  # fmt: skip
TYPES = (
    "int", "int[]", "float", "float[]", "point3f[]", "color3f[]", "double3", "matrix4d", "quath[]",
    "token", "token[]", "string", "asset", "asset[]", "bool", "half", "int64[]", "float2[]",
    "matrix4d[]", "timecode", "dictionary", "nonsense", "texCoord2f[]", "uchar[]", "float4[]",
)  # fmt: skip
PRIMS = (
    "Mesh", "Xform", "Camera", "PointInstancer", "Sphere", "Cube", "Material", "Shader", "Scope",
    "DomeLight", "SphereLight", "GeomSubset", "NodeGraph", "SkelRoot", "BasisCurves", "Points",
    "NurbsPatch", "NurbsCurves", "HermiteCurves", "Volume", "RenderSettings", "TetMesh", "Nonsense",
    "",
)  # fmt: skip


def flip_bits(rng: random.Random, data: bytes) -> bytes:
    """Flips a few bits anywhere."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 8, 32))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def cut(rng: random.Random, data: bytes) -> bytes:
    """Truncates the end, or sometimes removes the beginning or appends data."""
    how = rng.random()
    where = rng.randrange(len(data) + 1)
    if how < 0.8:
        return data[:where]
    return data[where:] if how < 0.9 else data + data[:where]


def huge_words(rng: random.Random, data: bytes) -> bytes:
    """Replaces words of 2, 4 or 8 bytes by huge counts and offsets."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        size = rng.choice((2, 4, 8))
        value = rng.choice(HUGE) if rng.random() < 0.8 else rng.getrandbits(64)
        order = rng.choice("<<>")
        word = struct.pack(order + "Q", value & ((1 << 64) - 1))
        word = word[:size] if order == "<" else word[-size:]
        head = rng.random() < 0.4
        at = rng.randrange(max(1, min(len(out), 160) if head else len(out)))
        out[at : at + size] = word
    return bytes(out[: len(data)])


def splice(rng: random.Random, data: bytes) -> bytes:
    """Copies a block over another one, or clears, removes or duplicates it."""
    out = bytearray(data)
    size = rng.randrange(1, max(2, len(out) // 8))
    source, target = (rng.randrange(max(1, len(out) - size)) for _ in range(2))
    how = rng.randrange(4)
    if how == 0:
        out[target : target + size] = out[source : source + size]
    elif how == 1:
        out[target : target + size] = bytes(size)
    elif how == 2:
        del out[target : target + size]
    else:
        out[target:target] = out[source : source + size]
    return bytes(out)


def tail_words(rng: random.Random, data: bytes) -> bytes:
    """Applies ``huge_words`` near the end, where .usdc files have tables and .usdz files names."""
    start = len(data) * 2 // 3
    return data[:start] + huge_words(rng, data[start:])


_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
_TYPE = re.compile(
    r"\b(?:int|float|double|point3f|color3f|texCoord2f|token|asset|matrix4d|rel)\d?(?:\[\])?(?= )"
)
_PRIM = re.compile(r"(?<=def )\w+(?= \")")
_LIST = re.compile(r"\[[^\[\]]*\]")
_PATH = re.compile(r"</[^<>]*>")


def _swap(rng: random.Random, text: str, form: re.Pattern[str], words: Callable[[str], str]) -> str:
    found = list(form.finditer(text))
    if not found:
        return text
    match = rng.choice(found)
    return text[: match.start()] + words(match.group()) + text[match.end() :]


def _resized(rng: random.Random, text: str) -> str:
    items = re.findall(r"\([^()]*\)|[^,\[\]\s][^,\[\]]*", text)
    count = rng.choice((0, 1, max(0, len(items) - 1), len(items) + 1, 2 * len(items), 5000))
    return "[" + ", ".join((items * (count // max(1, len(items)) + 1))[:count]) + "]"


def change_words(rng: random.Random, data: bytes) -> bytes:
    """Replaces numbers, types, lists and paths in the text. The text usually still parses."""
    text = data.decode()
    paths = _PATH.findall(text)
    for _ in range(rng.choice((1, 1, 2, 3, 6))):
        how = rng.random()
        if how < 0.3:
            text = _swap(rng, text, _NUMBER, lambda _: rng.choice(NUMBERS))
        elif how < 0.45:
            text = _swap(rng, text, _TYPE, lambda _: rng.choice(TYPES))
        elif how < 0.55:
            text = _swap(rng, text, _PRIM, lambda _: rng.choice(PRIMS))
        elif how < 0.8:
            text = _swap(rng, text, _LIST, lambda old: _resized(rng, old))
        else:
            text = _swap(rng, text, _PATH, lambda _: rng.choice([*paths, "</>", "</Gone>", "<..>"]))
    return text.encode()


def change_lines(rng: random.Random, data: bytes) -> bytes:
    """Removes, duplicates or swaps lines."""
    lines = data.decode().splitlines(keepends=True)
    for _ in range(rng.choice((1, 2, 4))):
        a, b = rng.randrange(1, len(lines)), rng.randrange(1, len(lines))
        how = rng.randrange(3)
        if how == 0:
            del lines[a]
        elif how == 1:
            lines.insert(b, lines[a])
        else:
            lines[a], lines[b] = lines[b], lines[a]
    return "".join(lines).encode()


def wrong_types(rng: random.Random, data: bytes) -> bytes:
    """Sets attributes to values of other types and lengths through the USD library, as .usdc."""
    import tempfile

    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(stage_text())
    found: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, found.append)
    attributes = [
        path for path in found if path.IsPropertyPath() and layer.GetAttributeAtPath(path)
    ]
    for path in rng.sample(attributes, rng.choice((1, 2, 4, 8))):
        old = layer.GetAttributeAtPath(path)
        name = old.name
        owner = getattr(old.owner, "primSpec", old.owner)
        donor = layer.GetAttributeAtPath(rng.choice(attributes))
        if donor is None:
            continue
        kind, value = donor.typeName, donor.default
        samples = layer.ListTimeSamplesForPath(donor.path)
        del owner.properties[name]
        new = Sdf.AttributeSpec(owner, name, kind)
        if value is not None:
            new.default = value
        for time in samples:
            layer.SetTimeSample(new.path, time, layer.QueryTimeSample(donor.path, time))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "stage.usdc")
        layer.Export(str(file))
        return file.read_bytes()


STAGES: dict[str, tuple[str, Mutation]] = {
    "usda bits": ("usda", flip_bits),
    "usda cut": ("usda", cut),
    "usda splice": ("usda", splice),
    "usda words": ("usda", change_words),
    "usda lines": ("usda", change_lines),
    "usdc bits": ("usdc", flip_bits),
    "usdc cut": ("usdc", cut),
    "usdc counts": ("usdc", huge_words),
    "usdc sections": ("usdc", tail_words),
    "usdc splice": ("usdc", splice),
    "usdc types": ("usdc", wrong_types),
    "usdz": (
        "usdz",
        lambda rng, data: rng.choice((flip_bits, cut, huge_words, tail_words))(rng, data),
    ),
}

PICTURES: dict[str, Mutation] = {
    "bits": flip_bits, "cut": cut, "counts": huge_words, "splice": splice,
}  # fmt: skip

KINDS = (
    *STAGES,
    *GRAPHS,
    *(f"{suffix} {how}" for suffix in IMAGES for how in PICTURES),
    *INPUTS,
)


def make_case(kind: str, seed: int, number: int, folder: Path) -> Path:
    """Writes the files of a case to an empty folder. Returns the stage or other file to read."""
    rng = random.Random(f"{seed}/{kind}/{number}")
    (folder / "other.usda").write_text(OTHER)
    if kind in INPUTS:
        (folder / "a.png").write_bytes(image_bytes("png"))
        return make_input(kind, rng, folder, list(PICTURES.values()))
    if kind in GRAPHS:
        return GRAPHS[kind](rng, folder)
    if kind in STAGES:
        suffix, mutation = STAGES[kind]
        stage = folder / f"stage.{suffix}"
        stage.write_bytes(mutation(rng, stage_bytes(suffix)))
        if suffix != "usdz":
            (folder / "a.png").write_bytes(image_bytes("png"))
            (folder / "a.hdr").write_bytes(image_bytes("hdr"))
        return stage
    suffix, how = kind.split()
    broken = f"broken.{suffix}"
    (folder / broken).write_bytes(PICTURES[how](rng, image_bytes(suffix)))
    (folder / "a.png").write_bytes(image_bytes("png"))
    names = (
        (broken, broken)
        if rng.random() < 0.3
        else rng.choice(((broken, "a.png"), ("a.png", broken)))
    )
    stage = folder / "stage.usda"
    stage.write_text(stage_text(*names))
    return stage


def plan(total: int) -> list[tuple[str, int]]:
    """Returns (kind, number) of ``total`` cases, cycling through all kinds."""
    return [(KINDS[i % len(KINDS)], i // len(KINDS)) for i in range(total)]
