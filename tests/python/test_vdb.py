# SPDX-License-Identifier: Apache-2.0
"""Tests the plug-in that reads and writes .vdb files: values, tiles, names and broken files."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import asset, needs, only_where

from wavecomb import vdb
from wavecomb.errors import WavecombError

pytestmark = [
    needs("wavecomb._core"),
    only_where(vdb.is_there(), "this build is without OpenVDB"),
]

EDGE = vdb.BRICK


def noise(count: int, channels: int = 1, dtype: type = np.float32, seed: int = 1) -> dict[str, Any]:
    """Returns bricks at random positions with nonzero values."""
    rng = np.random.default_rng(seed)
    cells = rng.choice(40**3, count, replace=False)
    origins = (np.stack(np.unravel_index(cells, (40,) * 3), 1) - 20) * EDGE
    shape = (count, EDGE, EDGE, EDGE, *((3,) if channels == 3 else ()))
    values = rng.uniform(0.01, 2, shape).astype(dtype)
    matrix = np.array([[0.1, 0.02, 0, 0], [0, 0.2, 0, 0], [0, 0.03, 0.1, 0], [1, 2, 3, 1.0]])
    return {"origins": origins.astype(np.int32), "values": values, "index_to_object": matrix}


def in_order(origins: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.lexsort(origins.T)
    return origins[order], values[order]


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_a_grid_comes_back_bit_for_bit(tmp_path: Path, channels: int, dtype: type) -> None:
    made = noise(50, channels, dtype)
    if channels == 1:
        made["values"].flat[:3] = [-0.0, 0.0, 1e-30 if dtype is np.float32 else 6e-8]
    path = tmp_path / "a.vdb"
    vdb.write(path, [{"name": "some", **made}])
    (head,) = vdb.grid_heads(path)
    assert (head.name, head.index) == ("some", 0)
    got = vdb.read(path, head)
    assert got.values.dtype == dtype and got.origins.dtype == np.int32
    wanted, found = in_order(made["origins"], made["values"]), in_order(got.origins, got.values)
    assert np.array_equal(wanted[0], found[0])
    assert wanted[1].tobytes() == found[1].tobytes()
    assert np.allclose(got.index_to_object, made["index_to_object"], atol=1e-15)
    assert got.background == (0.0,) * channels


def test_the_same_grids_give_the_same_bytes(tmp_path: Path) -> None:
    files = [tmp_path / "a.vdb", tmp_path / "b.vdb"]
    for file in files:
        vdb.write(file, [{"name": "d", **noise(5)}])
    assert files[0].read_bytes() == files[1].read_bytes()
    assert len(vdb.grid_heads(files[0])) == 1


def test_names_may_be_those_of_several_grids(tmp_path: Path) -> None:
    path = tmp_path / "a.vdb"
    some = [("density", 3), ("heat", 4), ("density", 5)]
    vdb.write(path, [{"name": name, **noise(count, seed=count)} for name, count in some])
    heads = vdb.grid_heads(path)
    assert {(head.name, head.index) for head in heads} == {
        ("density", 0), ("heat", 0), ("density", 1),
    }  # fmt: skip
    counts = {(head.name, head.index): len(vdb.read(path, head).origins) for head in heads}
    assert counts["heat", 0] == 4
    assert {counts["density", 0], counts["density", 1]} == {3, 5}


def test_what_is_said_of_a_grid(tmp_path: Path) -> None:
    path = tmp_path / "a.vdb"
    made = noise(2)
    made["origins"] = np.array([[0, 0, 0], [-8, 16, 24]], np.int32)
    vdb.write(path, [{"name": "d", **made}])
    (info,) = vdb.grids(path)
    assert (info.value_name, info.kind, info.is_read) == ("float", "fog volume", True)
    assert info.voxels == 2 * EDGE**3
    assert info.box is not None and info.box.tolist() == [[-8, 0, 0], [7, 23, 31]]
    assert info.index_to_object is not None and np.allclose(
        info.index_to_object, made["index_to_object"]
    )
    assert info.metadata["class"] == "fog volume"


def test_bricks_of_zeros_may_be_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.vdb"
    made = noise(4)
    made["values"][1] = 0
    vdb.write(path, [{"name": "d", **made}])
    (head,) = vdb.grid_heads(path)
    assert len(vdb.read(path, head).origins) == 4
    assert len(vdb.read(path, head, whole=False).origins) == 3


@pytest.mark.slow
def test_tiles_come_as_bricks(tmp_path: Path) -> None:
    """16^3 equal bricks are one tile, and a single brick is a tile of 8^3 voxels."""
    path = tmp_path / "a.vdb"
    cells = np.stack(np.meshgrid(*[np.arange(16)] * 3, indexing="ij"), -1).reshape(-1, 3)
    origins = np.concatenate([cells - 16, [[3, 3, 3]]]).astype(np.int32) * EDGE
    values = np.full((len(origins), EDGE, EDGE, EDGE), 0.75, np.float16)
    values[-1] = 2
    made = {"origins": origins, "values": values, "index_to_object": np.eye(4)}
    vdb.write(path, [{"name": "d", **made}, {"name": "tiles", "tiles": True, **made}])
    both = [vdb.read(path, head) for head in vdb.grid_heads(path)]
    for got in both:
        wanted, found = in_order(origins, values), in_order(got.origins, got.values)
        assert np.array_equal(wanted[0], found[0]) and np.array_equal(wanted[1], found[1])
        assert got.voxels == len(origins) * EDGE**3
    sizes = []
    for name in ("d", "tiles"):
        one = tmp_path / f"{name}.vdb"
        vdb.write(one, [{"name": name, "tiles": name == "tiles", **made}])
        sizes.append(one.stat().st_size)
    assert sizes[1] < sizes[0] / 10


def test_tiles_of_all_sizes(tmp_path: Path) -> None:
    """Tiles of 4096, 128 and 8 voxels per side.

    A brick inside a tile does not affect the rest of the tile.
    """
    path = tmp_path / "a.vdb"
    made = noise(1)
    made["origins"][:] = (4096 + 128, 0, 0)
    made["values"][:] = 0.0
    made["values"][0, 0, 0, 0] = 7.0
    made["boxes"] = [
        ((-4096, 0, 0), (-1, 4095, 4095), 0.5),
        ((4096, 0, 0), (4096 + 255, 127, 127), 2.0),
        ((0, -8, 0), (7, -1, 7), 3.0),
    ]
    vdb.write(path, [{"name": "d", **made}])
    (info,) = vdb.grids(path)
    assert info.voxels == 4096**3 + 256 * 128 * 128 + 8**3
    assert info.box is not None
    assert info.box.tolist() == [[-4096, -8, 0], [4096 + 255, 4095, 4095]]
    assert path.stat().st_size < 100_000
    made["boxes"] = made["boxes"][1:]
    vdb.write(path, [{"name": "d", **made}])
    got = vdb.read(path, vdb.grid_heads(path)[0])
    (leaf,) = np.flatnonzero((got.origins == made["origins"][0]).all(axis=1))
    assert got.values[leaf].flat[0] == 7.0 and (got.values[leaf].reshape(-1)[1:] == 2.0).all()
    assert len(got.origins) == 2 * 16**3 + 1 and got.voxels == 512 * len(got.origins)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"origins": np.array([[0, 0, 4]], np.int32)}, "origins must be multiples of 8"),
        ({"origins": np.zeros((2, 3), np.int32)}, "bricks of another shape"),
        ({"index_to_object": np.zeros((4, 4))}, "a transform without an inverse"),
    ],
)
def test_what_cannot_be_written_is_one_line(
    tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    with pytest.raises(WavecombError, match=f"a.vdb: {said}"):
        vdb.write(tmp_path / "a.vdb", [{"name": "d", **noise(1), **change}])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", ["int32", "bool", "vec3i"])
def test_a_type_that_is_not_read_is_named(tmp_path: Path, kind: str) -> None:
    """The table lists grids of other types. Reading such a grid gives an error with its type."""
    path = tmp_path / "a.vdb"
    vdb.write(path, [{"name": "d", **noise(1)}])
    data = path.read_bytes()
    word = b"Tree_float_5_4_3"
    other = f"Tree_{kind}_5_4_3".encode()
    at = data.index(word)
    # The table entry changes its length, so all offsets after it change.
    moved = len(other) - len(word)
    row = at + len(word) + 4
    places = struct.pack("<qqq", *(p + moved for p in struct.unpack_from("<qqq", data, row)))
    data = (
        data[: at - 4] + struct.pack("<I", len(other)) + other
        + data[at + len(word) : row] + places + data[row + 24 :]
    )  # fmt: skip
    path.write_bytes(data)
    (head,) = vdb.grid_heads(path)
    assert head.value_name == kind and not head.is_of_numbers
    with pytest.raises(WavecombError) as error:
        vdb.read(path, head)
    said = str(error.value)
    assert said.startswith(f"{path}: grid 'd': ") and f"of type {kind}, which is not read" in said


def test_what_is_not_finite_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.vdb"
    made = noise(2)
    made["values"].flat[:4] = [np.nan, np.inf, -np.inf, -2.0]
    vdb.write(path, [{"name": "d", **made}])
    got = vdb.read(path, vdb.grid_heads(path)[0])
    assert (got.not_finite, got.negative, got.least) == (3, 1, -2.0)


def test_one_scheduler_of_threads(tmp_path: Path) -> None:
    """The plug-in and the core share one oneTBB."""
    script = (
        "from wavecomb import vdb; assert vdb.is_there(); import re\n"
        "maps = open('/proc/self/maps').read()\n"
        "print(len(set(re.findall(r'/\\S*libtbb\\.so\\S*', maps))))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.strip() == "1"


# Broken files


@pytest.mark.parametrize("keep", [0, 3, 8, 20, 60, 300, 0.5, 0.99])
def test_a_file_that_is_cut_off_is_one_line(tmp_path: Path, keep: float) -> None:
    path = tmp_path / "a.vdb"
    vdb.write(path, [{"name": "d", **noise(20)}])
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if isinstance(keep, float) else keep])
    with pytest.raises(WavecombError) as error:
        vdb.grid_heads(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_no_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(WavecombError, match=r"gone.vdb: No such file"):
        vdb.grid_heads(tmp_path / "gone.vdb")
    path = tmp_path / "text.vdb"
    path.write_text("not a grid, but longer than a head would be" * 10)
    with pytest.raises(WavecombError, match=r"text.vdb: no .vdb file that can be read: "):
        vdb.grid_heads(path)


def test_tables_that_lead_in_a_circle_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.vdb"
    vdb.write(path, [{"name": "d", **noise(3)}])
    data = bytearray(path.read_bytes())
    size = struct.pack("<q", len(data))
    at = data.rindex(size, 0, 400)
    data[at : at + 8] = struct.pack("<q", 57)
    path.write_bytes(data)
    with pytest.raises(WavecombError, match="grid offsets are out of order"):
        vdb.grid_heads(path)


def test_more_than_there_is_room_for_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.vdb"
    vdb.write(path, [{"name": "d", **noise(200)}])
    monkeypatch.setattr("wavecomb.run.isolation.memory.available_bytes", lambda: 100_000)
    with pytest.raises(WavecombError, match="there is room for"):
        vdb.read(path, vdb.grid_heads(path)[0])


def huge(path: Path) -> None:
    """Writes a billion voxels as a few tiles."""
    made = noise(1)
    made["boxes"] = [((0, 0, 0), (1023, 1023, 1023), 0.5)]
    vdb.write(path, [{"name": "density", **made}])
    assert path.stat().st_size < 100_000


def test_a_thousand_million_voxels_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.vdb"
    huge(path)
    (info,) = vdb.grids(path)
    assert info.voxels >= 1024**3
    monkeypatch.setattr("wavecomb.run.isolation.memory.available_bytes", lambda: 4_000_000_000)
    with pytest.raises(WavecombError, match=r"107\d million voxels take 4.3 GB; there is room for"):
        vdb.read(path, vdb.grid_heads(path)[0])


@pytest.mark.slow
def test_the_memory_limit_holds(tmp_path: Path) -> None:
    """The memory limit of the command applies to the process that reads the file."""
    huge(tmp_path / "a.vdb")
    stage = tmp_path / "s.usda"
    stage.write_text(
        '#usda 1.0\ndef Volume "V" {\nrel field:density = </V/d>\n'
        'def OpenVDBAsset "d" {\nasset filePath = @./a.vdb@\ntoken fieldName = "density"\n}\n}\n'
    )
    words = ["-m", "wavecomb", "info", str(stage), "--memory-limit", "600"]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert "/V/d" in line and "million voxels" in line


# Files of others


def test_smoke_of_arnold() -> None:
    path = asset("reference/arnold-usd/test_0030/data/smoke.vdb")
    (head, *_) = [head for head in vdb.grid_heads(path) if head.name == "density"]
    got = vdb.read(path, head)
    active = sum(info.voxels for info in vdb.grids(path) if info.name == "density")
    assert got.voxels == active > 0
    assert got.not_finite == 0
    filled = int((got.values > 0).sum())
    assert 0 < filled <= len(got.values) * EDGE**3


def test_spheres_of_openimageio() -> None:
    for name, kind in (("sphere", "float"), ("sphereCd", "vec3s")):
        path = asset(f"volumes/{name}.vdb")
        values = {info.name: info.value_name for info in vdb.grids(path)}
        assert kind in " ".join(values.values()) or "half" in " ".join(values.values())
        for head in vdb.grid_heads(path):
            got = vdb.read(path, head)
            assert len(got.origins) == len(np.unique(got.origins, axis=0)) > 0
