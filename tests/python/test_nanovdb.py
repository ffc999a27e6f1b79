# SPDX-License-Identifier: Apache-2.0
"""Tests .nvdb files: values, quantised values, names, compression and broken files."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import nvdb
import pytest
from fuzz_inputs import VOLUME, vdb_bytes
from parts import needs
from test_vdb import EDGE, in_order, noise

import wavecomb
from wavecomb import vdb
from wavecomb.errors import WavecombError

pytestmark = [
    needs("wavecomb._core"),
    nvdb.needs_nvdb(),
]

GRID_BYTES = 672
"""Size of nanovdb::GridData, which the tree follows."""


def read_all(path: Path, **options: Any) -> list[vdb.Bricks]:
    return [vdb.read(path, head, **options) for head in vdb.grid_heads(path)]


def same(a: vdb.Bricks, b: vdb.Bricks) -> bool:
    one, two = in_order(a.origins, a.values), in_order(b.origins, b.values)
    return np.array_equal(one[0], two[0]) and one[1].tobytes() == two[1].tobytes()


@pytest.mark.parametrize("packed", ["none", "zip", "blosc"])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_grid_is_that_of_the_vdb_file(tmp_path: Path, channels: int, packed: str) -> None:
    made = {"name": "some", **noise(40, channels)}
    vdb.write(tmp_path / "a.vdb", [made])
    nvdb.write(tmp_path / "a.nvdb", [made], packed)
    (one,), (two,) = read_all(tmp_path / "a.vdb"), read_all(tmp_path / "a.nvdb")
    assert same(one, two)
    assert one.index_to_object is not None and two.index_to_object is not None
    assert one.index_to_object.tobytes() == two.index_to_object.tobytes()
    for name in ("background", "kind", "voxels", "not_finite", "negative", "least", "greatest"):
        assert getattr(one, name) == getattr(two, name), name
    assert np.array_equal(one.box, two.box)  # type: ignore[arg-type]


def test_several_grids_and_names(tmp_path: Path) -> None:
    path, long = tmp_path / "a.nvdb", "d" * 300
    some = [("density", 3), (long, 4), ("density", 5)]
    nvdb.write(path, [{"name": name, **noise(count, seed=count)} for name, count in some])
    heads = vdb.grid_heads(path)
    assert [(head.name, head.index) for head in heads] == [
        ("density", 0),
        (long, 0),
        ("density", 1),
    ]
    assert [len(bricks.origins) for bricks in read_all(path)] == [3, 4, 5]
    assert heads[0].value_name == "float"
    # A file with several segments, as written by a program that appends grids.
    both = tmp_path / "both.nvdb"
    both.write_bytes(path.read_bytes() * 2)
    assert [head.index for head in vdb.grid_heads(both)] == [0, 0, 1, 2, 1, 3]
    assert len(vdb.read(both, vdb.grid_heads(both)[5]).origins) == 5


@pytest.mark.parametrize(
    ("bits", "most"), [("4", 1 / 30), ("8", 1 / 510), ("16", 1.6e-5), ("n", 0.0101)]
)
def test_quantised_leaves(tmp_path: Path, bits: str, most: float) -> None:
    """The error is at most half a quantisation step of the leaf, or for "n" the fog tolerance."""
    made = noise(20)
    nvdb.write(tmp_path / "a.nvdb", [{"name": "d", "bits": bits, **made}], "blosc")
    (head,) = vdb.grid_heads(tmp_path / "a.nvdb")
    assert head.value_name == f"fp{bits}" and not head.is_vector
    (got,) = read_all(tmp_path / "a.nvdb")
    wanted, found = in_order(made["origins"], made["values"]), in_order(got.origins, got.values)
    assert np.array_equal(wanted[0], found[0]) and found[1].dtype == np.float32
    error = float(np.abs(wanted[1] - found[1]).max())
    assert 0 < error <= 2.02 * most


def test_tiles_come_as_bricks(tmp_path: Path) -> None:
    made = noise(1)
    made["origins"][:] = 4096
    made["boxes"] = [((0, 0, 0), (127, 127, 127), 0.5), ((-8, -8, -8), (-1, -1, -1), 0.25)]
    for name, write in (("a.vdb", vdb.write), ("a.nvdb", nvdb.write)):
        write(tmp_path / name, [{"name": "d", "tiles": True, **made}])
    (one,), (two,) = read_all(tmp_path / "a.vdb"), read_all(tmp_path / "a.nvdb")
    assert same(one, two) and len(two.origins) == 16**3 + 2


def test_the_same_grids_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.nvdb", "b.nvdb"):
        nvdb.write(tmp_path / name, [{"name": "d", "bits": "n", **noise(5)}], "zip")
    assert (tmp_path / "a.nvdb").read_bytes() == (tmp_path / "b.nvdb").read_bytes()


def test_a_picture_is_that_of_the_vdb_file(tmp_path: Path) -> None:
    """Image and messages are the same as for the .vdb file."""
    pictures = []
    for name in ("a.vdb", "a.nvdb"):
        (tmp_path / name).write_bytes(vdb_bytes(name))
        stage = tmp_path / f"{name}.usda"
        stage.write_text(VOLUME.replace("a.vdb", name))
        pictures.append(wavecomb.render(stage, size=(24, 24), spp=4).beauty)
    assert pictures[0].max() > 0 and pictures[0].tobytes() == pictures[1].tobytes()


def test_such_files_are_read_and_not_written(tmp_path: Path) -> None:
    with pytest.raises(WavecombError, match=r"a.nvdb: .nvdb files are read, not written"):
        vdb.write(tmp_path / "a.nvdb", [{"name": "d", **noise(1)}])
    assert not list(tmp_path.iterdir())


# Broken files


def broken(tmp_path: Path, change: Any) -> str:
    """Returns the error message for a file whose bytes were changed."""
    path = tmp_path / "a.nvdb"
    nvdb.write(path, [{"name": "d", **noise(4)}])
    data = bytearray(path.read_bytes())
    path.write_bytes(change(data) or data)
    with pytest.raises(WavecombError) as error:
        read_all(path)
    text = str(error.value)
    assert str(path) in text and "\n" not in text
    return text


@pytest.mark.parametrize("keep", [9, 20, 100, 300, 1000, 0.5, 0.999])
def test_a_file_that_is_cut_off_is_one_line(tmp_path: Path, keep: float) -> None:
    said = broken(tmp_path, lambda d: d[: int(keep * len(d)) if isinstance(keep, float) else keep])
    assert "no .nvdb file that can be read: the file ends too early" in said


def put(at: int, value: int, code: str = "<Q") -> Any:
    def change(data: bytearray) -> None:
        struct.pack_into(code, data, at, value)

    return change


HEAD = 16 + 176 + len("d\0")
"""Number of bytes in a .nvdb file before its first grid."""
ROOT = HEAD + GRID_BYTES + 64


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (put(8, 33 << 21, "<I"), "format 33.0 of NanoVDB is newer than 32, which is read: convert"),
        (put(8, 31 << 21, "<I"), "format 31.0 of NanoVDB is older than 32"),
        (put(7, ord("1"), "<B"), "a grid without a header"),
        (put(14, 7, "<H"), "its compression is not known"),
        (put(0, int.from_bytes(b"NanoVDB0", "big")), "the other byte order"),
        (put(16, 2**60), "sizes of a grid are inconsistent"),
        (put(16 + 32, 9, "<I"), "it is of type Tree_half_5_4_3, which is not read"),
        (put(16 + 32, 2, "<I"), "differs from the file's table"),
        (put(HEAD, 0), "without a valid header"),
        (put(HEAD + 32, 2**63), "differs from the file's table"),
        (put(HEAD + 296 + 88 + 4, 0x7FF00000, "<I"), "whose transform has no inverse"),
        (put(HEAD + GRID_BYTES + 24, 2**64 - 64), "without a root"),
        (put(HEAD + GRID_BYTES + 24, 65), "nodes at invalid offsets"),
        (put(ROOT + 24, 2**32 - 1, "<I"), "nodes at invalid offsets"),
        (put(ROOT + 64 + 8, 2**62), "nodes at invalid offsets"),
        (put(ROOT + 64 + 8, 2**64 - 2**40), "nodes at invalid offsets"),
    ],
)  # fmt: skip
def test_what_is_broken_is_one_line(tmp_path: Path, change: Any, said: str) -> None:
    assert said in broken(tmp_path, change)


def test_more_than_there_is_room_for_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.nvdb"
    made = noise(1)
    made["boxes"] = [((0, 0, 0), (1023, 1023, 1023), 0.5)]
    nvdb.write(path, [{"name": "density", **made}])
    monkeypatch.setattr("wavecomb.run.isolation.memory.available_bytes", lambda: 4_000_000_000)
    with pytest.raises(WavecombError, match=r"107\d million voxels take 4.3 GB; there is room for"):
        read_all(path)
    monkeypatch.setattr("wavecomb.run.isolation.memory.available_bytes", lambda: 1000)
    with pytest.raises(WavecombError, match=r"the grid takes 0\.0 GB; there is room for"):
        read_all(path)


def test_numbers_that_are_none_are_counted(tmp_path: Path) -> None:
    made = noise(2)
    made["values"].flat[:4] = [np.nan, np.inf, -np.inf, -2.0]
    nvdb.write(tmp_path / "a.nvdb", [{"name": "d", **made}])
    (got,) = read_all(tmp_path / "a.nvdb")
    assert (got.not_finite, got.negative, got.least) == (3, 1, -2.0)
    assert got.values.shape == (2, EDGE, EDGE, EDGE)


def test_grids_of_integers_are_listed_and_left_out(tmp_path: Path) -> None:
    data = bytearray(vdb_bytes("a.nvdb"))
    struct.pack_into("<I", data, 16 + 32, 4)
    (tmp_path / "a.nvdb").write_bytes(data)
    assert vdb.grid_heads(tmp_path / "a.nvdb")[0].value_name == "int32"
    stage = tmp_path / "s.usda"
    stage.write_text(VOLUME.replace("a.vdb", "a.nvdb"))
    report = "\n".join(wavecomb.load(stage).report.lines())
    assert "grids of int32 (left out)" in report and "/Smoke/density" in report


@pytest.mark.slow
def test_a_command_says_one_line(tmp_path: Path) -> None:
    stage = tmp_path / "s.usda"
    stage.write_text(VOLUME.replace("a.vdb", "a.nvdb"))
    (tmp_path / "a.nvdb").write_bytes(vdb_bytes("a.nvdb")[:5000])
    words = ["-m", "wavecomb", "info", str(stage)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert "a.nvdb" in line and "ends too early" in line
