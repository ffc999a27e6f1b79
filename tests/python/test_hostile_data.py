# SPDX-License-Identifier: Apache-2.0
"""Tests that malicious checkpoints, images and documents soon cause one error line."""

from __future__ import annotations

import gzip
import io
import json
import os
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from pxr import Usd
from test_usd_mtlx import GOLD, write

import wavecomb
from wavecomb import WavecombError
from wavecomb.cli import main
from wavecomb.image.files.archive import ArchiveError, read_archive
from wavecomb.image.files.exr import write_exr
from wavecomb.run.checkpoint import load_checkpoint, save_checkpoint
from wavecomb.scenes.models import mesh_file
from wavecomb.scenes.models.mesh_file import load_dragon
from wavecomb.usd import load_stage
from wavecomb.usd.lights.ies import IesTable
from wavecomb.usd.materialx.files import MtlxError, read_document
from wavecomb.usd.stage.context import LoadContext

SOON_S = 5.0
DEEP = 20_000


def invoke(*words: object) -> tuple[int, str]:
    """Runs a command within a time limit. Returns its exit code and stderr."""
    start = time.process_time()
    result = CliRunner().invoke(main, [*map(str, words), "--isolate", "off"])
    assert time.process_time() - start < SOON_S
    assert "Traceback" not in result.output and "internal:" not in result.output, result.output
    return result.exit_code, result.stderr


def says(words: str, *command: object) -> None:
    code, stderr = invoke(*command)
    assert code == 2 and stderr.count("\n") == 1, stderr
    assert stderr.startswith("error: ") and words in stderr, stderr


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hostile") / "ball.usda"
    path.write_text('#usda 1.0\ndef Sphere "Ball" {\n    double radius = 1\n}\n')
    return path


# ---- checkpoints ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(stage: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("whole") / "a.ckpt"
    wavecomb.render(stage, size=(8, 8), spp=2, checkpoint=file)
    return file


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def lying_npy(shape: str, values: bytes = b"") -> bytes:
    """Returns an array whose header claims more data than there is."""
    text = f"{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + values


def archive(path: Path, parts: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> None:
    with zipfile.ZipFile(path, "w", method) as file:
        for name, data in parts.items():
            file.writestr(f"{name}.npy", data)


def text(content: str) -> bytes:
    return npy(np.frombuffer(content.encode(), np.uint8))


ARCHIVES: dict[str, Callable[[Path], None]] = {
    "JSON in JSON": lambda f: archive(f, {"header": text("[" * DEEP + "]" * DEEP)}),
    "JSON of no kind": lambda f: archive(f, {"header": text("[1, 2]")}),
    "no JSON": lambda f: archive(f, {"header": text("\x00")}),
    "no text": lambda f: archive(f, {"header": npy(np.full(9, 0xFF, np.uint8))}),
    "objects": lambda f: archive(f, {"header": npy(np.array([{}], object))}),
    "a bomb": lambda f: archive(f, {"header": bytes(1 << 25)}, zipfile.ZIP_DEFLATED),
    "a shape that lies": lambda f: archive(f, {"header": lying_npy("(10**15,)")}),
    "a large shape": lambda f: archive(f, {"header": lying_npy("(1000000000000000,)")}),
    "shapes in shapes": lambda f: archive(f, {"header": lying_npy("(" * 4000 + ")" * 4000)}),
    "many parts": lambda f: archive(f, {str(i): b"" for i in range(5000)}),
}


@pytest.mark.parametrize("kind", ARCHIVES)
def test_archives_that_are_no_checkpoints(stage: Path, tmp_path: Path, kind: str) -> None:
    file = tmp_path / "a.ckpt"
    ARCHIVES[kind](file)
    out = tmp_path / "o.exr"
    says("a.ckpt: is not a checkpoint, or is damaged", "render", stage, "-o", out, "--resume", file)
    says("exists and is not a checkpoint", "render", stage, "-o", out, "--checkpoint", file)
    assert os.listdir(tmp_path) == ["a.ckpt"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parts", "method", "words"),
    [
        # A valid archive, except that it would decompress to 128 MB.
        ({"header": text("{}"), "a": npy(np.zeros(1 << 24))}, zipfile.ZIP_DEFLATED, "compressed"),
        (
            {"header": text("{}"), "a": lying_npy("(1000,)")},
            zipfile.ZIP_STORED,
            "declares more data than",
        ),
        (
            {"header": text("{}"), "a": lying_npy("(-1,)", b"1")},
            zipfile.ZIP_STORED,
            "declares more",
        ),
    ],
)
def test_archives_are_looked_at_before_they_are_read(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    parts: dict[str, bytes],
    method: int,
    words: str,
) -> None:
    file = tmp_path / "a.npz"
    archive(file, parts, method)
    read: list[object] = []
    monkeypatch.setattr(np, "load", lambda *a, **k: read.append(a))
    with pytest.raises(ArchiveError, match=words):
        read_archive(file)
    assert not read


def test_parts_that_overlap(whole: Path, tmp_path: Path) -> None:
    """All directory entries refer to the same bytes, so their total size exceeds the file's."""
    with zipfile.ZipFile(whole) as source:
        info, data = source.infolist()[0], source.read(source.infolist()[0])
    file = tmp_path / "a.ckpt"
    with zipfile.ZipFile(file, "w") as target:
        target.writestr(info.filename, data)
        first = target.infolist()[0]
        for i in range(100):
            again = zipfile.ZipInfo(f"{i}.npy")
            for name in ("header_offset", "CRC", "compress_size", "file_size", "flag_bits"):
                setattr(again, name, getattr(first, name))
            target.filelist.append(again)
            target.NameToInfo[again.filename] = again
        target._didModify = True
    with pytest.raises(WavecombError, match="is not a checkpoint, or is damaged"):
        load_checkpoint(file)


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("settings", []),
        ("settings", {}),
        ("settings", {"width": 8, "height": 8, "spp": "many"}),
        ("settings", {"width": 8, "height": 8, "spp": 2, "__class__": 1}),
        ("settings", {"width": -8, "height": 8, "spp": 2}),
        ("source", [1]),
        ("source", {"camera": 5}),
        ("source", {"mask": [[]]}),
        ("source", {"frame": float("nan")}),
        ("source", {"shutter": [1]}),
        ("scene", {"lights": 1}),
        ("aovs", [[]]),
        ("aovs", ["no such layer"]),
        ("seconds", "soon"),
        ("seconds", float("nan")),
        ("library", None),
        ("format", {}),
    ],
)
def test_headers_that_lie(stage: Path, whole: Path, tmp_path: Path, part: str, value: Any) -> None:
    good = load_checkpoint(whole)
    file = tmp_path / "a.ckpt"
    save_checkpoint(file, {**good.header, part: value}, good.state)
    says("", "render", stage, "-o", tmp_path / "o.exr", "--resume", file)
    assert not (tmp_path / "o.exr").exists()


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("pass.target", -1),
        ("pass.target", 1 << 40),
        ("pass.target", [1, 2]),
        ("pass.active", np.zeros((4, 4), np.float64)),
        ("film.beauty", np.zeros(3, np.complex128)),
        ("film.samples", np.zeros(7, np.uint8)),
    ],
)
def test_states_that_lie(stage: Path, whole: Path, tmp_path: Path, part: str, value: Any) -> None:
    good = load_checkpoint(whole)
    file = tmp_path / "a.ckpt"
    names = [name for name in good.state if name.startswith(part[:5])]
    save_checkpoint(file, good.header, {**good.state, part if "pass" in part else names[0]: value})
    size = ("--size", 8, 8, "--spp", 2)
    says("", "render", stage, "-o", tmp_path / "o.exr", "--resume", file, *size)


# ---- pictures that are merged --------------------------------------------------------------------

SETTINGS = {"width": 4, "height": 4, "seed": 1}


def exr(
    path: Path, layers: dict[str, tuple[int, int, int]] | None = None, **attributes: Any
) -> None:
    shapes = layers or {"beauty": (4, 4, 3), "samples": (4, 4, 1)}
    values = {name: np.ones(shape, np.float32) for name, shape in shapes.items()}
    known = {"wavecomb:settings": json.dumps(SETTINGS), "wavecomb:seeds": f"[{len(path.stem)}]"}
    named = {key.replace("__", ":"): value for key, value in attributes.items()}
    write_exr(path, values, metadata=known | named)


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"wavecomb__settings": "[" * DEEP}, "has no render settings"),
        ({"wavecomb__settings": "[1]"}, "has no render settings"),
        ({"wavecomb__settings": json.dumps({"width": 1 << 40, "height": 4, "seed": 1})}, "width"),
        ({"wavecomb__seeds": "[" * DEEP}, "has no render settings"),
        ({"wavecomb__seeds": "{}"}, "has no render settings"),
        ({"wavecomb__seeds": "[1e999]"}, "has no render settings"),
        ({"layers": {"beauty": (4, 4, 3), "samples": (4, 4, 3)}}, "layer samples is 4 x 4 with 3"),
        ({"layers": {"beauty": (4, 1, 3), "samples": (4, 1, 1)}}, "layer beauty is 1 x 4"),
        (
            {"layers": {"beauty": (4, 4, 4), "samples": (4, 4, 1)}},
            "has no layer A, which the other",
        ),
        (
            {"layers": {"beauty": (4, 4, 3), "samples": (4, 4, 1), "CryptoObject00": (4, 4, 3)}},
            "layer CryptoObject00",
        ),
    ],
)
def test_pictures_that_lie(tmp_path: Path, attributes: dict[str, Any], words: str) -> None:
    a, b = tmp_path / "a.exr", tmp_path / "bb.exr"
    exr(a)
    exr(b, **attributes)
    says(words, "merge", a, b, "-o", tmp_path / "o.exr")
    assert not (tmp_path / "o.exr").exists()


def test_manifests_and_matrices_that_lie(tmp_path: Path) -> None:
    a, b = tmp_path / "a.exr", tmp_path / "bb.exr"
    crypto = {"cryptomatte/abcdefg/name": "CryptoObject"}
    for manifest in ("[" * DEEP, "[1]", '{"a": 5}', '{"a": "xyz"}'):
        exr(a)
        exr(b, **crypto, **{"cryptomatte/abcdefg/manifest": manifest})
        says("manifest in it is damaged", "merge", a, b, "-o", tmp_path / "o.exr")
    odd = {"worldToCamera": "no matrix", "wavecomb__render_seconds": "no number"}
    exr(a, **odd)
    exr(b)
    assert invoke("merge", a, b, "-o", tmp_path / "o.exr")[0] == 0


def test_a_layer_is_no_path(tmp_path: Path) -> None:
    """A layer name that --split-aovs uses as file name cannot lead out of the folder."""
    a, b = tmp_path / "a.exr", tmp_path / "bb.exr"
    layers = {"beauty": (4, 4, 3), "samples": (4, 4, 1), "../../evil": (4, 4, 1)}
    exr(a, layers)
    exr(b, layers)
    says("cannot be part of a file's name", "merge", a, b, "-o", tmp_path / "o.exr", "--split-aovs")
    assert sorted(os.listdir(tmp_path)) == ["a.exr", "bb.exr"]


def test_a_picture_that_no_machine_holds(tmp_path: Path) -> None:
    """The header claims 500,000 x 500,000 pixels, and the file ends after it."""
    path = tmp_path / "a.exr"
    exr(path)
    data = bytearray(path.read_bytes())
    for name in (b"dataWindow", b"displayWindow"):
        at = data.index(name + b"\0box2i\0") + len(name) + 7 + 4
        data[at : at + 16] = np.array([0, 0, 499_999, 499_999], "<i4").tobytes()
    path.write_bytes(data)
    says("a.exr", "merge", path, path, "-o", tmp_path / "o.exr")
    says("a.exr", "compare", path, path)


# ---- IES profiles, MaterialX documents, meshes ---------------------------------------------------


def test_profiles_that_lie(tmp_path: Path) -> None:
    head = "IESNA:LM-63-2002\nTILT=NONE\n"
    factors = "1 2 0 0 0 1 1 1"
    files = {
        "counts": head + "1 1000 1 31623 31623 " + factors,
        "rows": head + "1 1000 1 1000000000 1 " + factors,
        "numbers": head + "1 1000 1 2 1 " + factors + " 7" * (1 << 21),
        "tilt": "TILT=INCLUDE\n1 1000000000 " + factors,
    }
    stage = Usd.Stage.CreateInMemory()
    context = LoadContext(stage, Usd.TimeCode.Default(), None)  # type: ignore[arg-type]
    table, report = IesTable(context), context.report
    start = time.process_time()
    for name, content in files.items():
        path = write(tmp_path, f"{name}.ies", content)
        if name != "numbers":
            assert table.add(str(path), "/L") is None
    assert table.add("/dev/zero", "/L") is None
    os.mkfifo(tmp_path / "pipe.ies")
    assert table.add(str(tmp_path / "pipe.ies"), "/L") is None
    assert len(report.warnings) == 5
    lines = [finding.line() for finding in report.warnings]
    for words in (
        "it declares 31623 x 31623 values",
        "it declares 1e+09 vertical angles",
        "it declares 1e+09 tilt angles",
        "not a regular file",
    ):
        assert any(words in line for line in lines), lines
    assert time.process_time() - start < SOON_S


def chain(folder: Path, links: int, each: int = 1) -> Path:
    """Returns documents, each of which includes the next document ``each`` times."""
    for i in range(links):
        lines = f'<xi:include href="d{i + 1}.mtlx"/>\n' * each
        write(
            folder,
            f"d{i}.mtlx",
            '<materialx version="1.38" xmlns:xi="http://www.w3.org/2001/XInclude">\n'
            f"{lines}</materialx>",
        )
    write(folder, f"d{links}.mtlx", GOLD)
    return folder / "d0.mtlx"


@pytest.mark.parametrize(
    ("links", "each", "words"),
    [
        (30, 1, None),
        (1000, 1, "in d31.mtlx, which it includes: more than 32 files include each other"),
        (20, 2, "includes more than 256 files"),
    ],
)
def test_documents_that_include_on_and_on(
    tmp_path: Path, links: int, each: int, words: str | None
) -> None:
    start = time.process_time()
    file = str(chain(tmp_path, links, each))
    if words is None:
        assert read_document(file).root.getMaterialNodes()
    else:
        with pytest.raises(MtlxError, match=words) as caught:
            read_document(file)
        assert len(str(caught.value)) < 200
    assert time.process_time() - start < SOON_S


def test_a_document_that_is_too_large(tmp_path: Path) -> None:
    file = write(tmp_path, "a.mtlx", GOLD)
    with file.open("r+b") as content:
        content.truncate(1 << 34)
    start = time.process_time()
    with pytest.raises(MtlxError, match="more than 64 MB"):
        read_document(str(file))
    stage = write(tmp_path, "s.usda", '#usda 1.0\ndef "A" ( references = @a.mtlx@ ) {}\n')
    warnings = [finding.line() for finding in load_stage(stage).report.warnings]
    assert any("more than 64 MB" in line for line in warnings)
    assert time.process_time() - start < SOON_S


PLY = "ply\nformat {}\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face {}\nproperty list uchar int vertex_indices\nend_header\n"


@pytest.mark.parametrize("style", ["ascii 1.0", "binary_little_endian 1.0"])
@pytest.mark.parametrize(
    ("vertices", "faces"),
    [("1000000000", "1"), ("3", "4000000000"), ("-1", "1"), ("9" * 5000, "1"), ("many", "1")],
)
def test_meshes_whose_counts_lie(tmp_path: Path, style: str, vertices: str, faces: str) -> None:
    start = time.process_time()
    file = tmp_path / "a.ply"
    file.write_bytes((PLY + FACES).format(style, vertices, faces).encode() + b"0 0 0 1 1 1")
    # The header alone is refused, before any array is read.
    words = "it cannot hold" if len(vertices + faces) < 20 and vertices != "many" else ""
    with pytest.raises(WavecombError, match=rf"a\.ply: not a usable mesh.*{words}"):
        load_dragon(file)
    assert time.process_time() - start < SOON_S


def test_a_mesh_without_properties(tmp_path: Path) -> None:
    file = tmp_path / "a.ply"
    text = "ply\nformat ascii 1.0\nelement vertex 100000000\nelement face 1\nend_header\n"
    with file.open("wb") as content:
        content.write(text.encode())
        content.truncate(1 << 27)
    start = time.process_time()
    with pytest.raises(WavecombError, match=r"a\.ply.* without properties"):
        load_dragon(file)
    assert time.process_time() - start < SOON_S


def test_a_mesh_that_unpacks_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_file, "MAX_UNPACKED", 1 << 20)
    file = tmp_path / "a.obj.gz"
    file.write_bytes(gzip.compress(bytes(1 << 24)))
    with pytest.raises(WavecombError, match=r"a\.obj\.gz.* unpacks to more than 1 MB"):
        load_dragon(file)
