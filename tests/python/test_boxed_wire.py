# SPDX-License-Identifier: Apache-2.0
"""What comes from a sandbox is checked byte by byte: nothing but a scene comes of it, or a line."""

from __future__ import annotations

import contextlib
import json
import random
import socket
import struct
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs

from wavecomb.errors import WavecombError
from wavecomb.run.boxed.wire import Message, Receiver, Refused, Sender

pytestmark = needs("wavecomb._core")

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
MESH = {"positions": QUAD, "indices": FACES, "name": "/Quad"}


def stream_of(send: Callable[[Sender], Any]) -> bytes:
    """The bytes that a sender writes."""
    mine, its = socket.socketpair()
    got = bytearray()

    def read() -> None:
        while more := mine.recv(1 << 16):
            got.extend(more)

    reader = threading.Thread(target=read)
    reader.start()
    try:
        send(Sender(its))
    finally:
        its.shutdown(socket.SHUT_WR)
        reader.join()
        mine.close()
        its.close()
    return bytes(got)


def receiver_of(stream: bytes, limit: int | None = None) -> Receiver:
    """Who receives these bytes, and then the end."""
    mine, its = socket.socketpair()

    def write() -> None:
        with contextlib.suppress(OSError):
            its.sendall(stream)
        its.close()

    threading.Thread(target=write, daemon=True).start()
    return Receiver(mine, limit)


def messages_of(stream: bytes, limit: int | None = None) -> list[Message]:
    receiver = receiver_of(stream, limit)
    found = []
    while (message := receiver.receive()) is not None:
        found.append(message)
    return found


def head(value: Any) -> bytes:
    data = value if isinstance(value, bytes) else json.dumps(value).encode()
    return struct.pack("=I", len(data)) + data


def call(name: str, arguments: dict[str, Any], **more: Any) -> Message:
    """A call as it comes."""
    body = {"call": name, "with": arguments, **more}
    (message,) = messages_of(stream_of(lambda sender: sender.send("call", body)))
    return message


def replay() -> Any:
    from wavecomb import _core
    from wavecomb.run.boxed.replay import Replay

    return Replay(_core.SceneBuilder(1), scenes={})


def test_values_and_arrays_arrive_as_they_were() -> None:
    sent = {
        "numbers": [0.1, float("inf"), 1 << 40, np.float32(0.3), np.uint32(7), True, None],
        "text": "caf\u00e9 \udce9",
        "bytes": b"\x00\xff",
        "none": np.zeros((0, 3), np.float32),
        "turned": np.arange(6, dtype=np.float64).reshape(2, 3).T,
        "deep": {"pair": ("vertex", np.array([1, 2], np.uint32))},
    }
    (got,) = messages_of(stream_of(lambda sender: sender.send("kind", sent)))
    assert got.kind == "kind"
    body = got.body
    assert body["numbers"] == [0.1, float("inf"), 1 << 40, float(np.float32(0.3)), 7, True, None]
    assert body["text"] == sent["text"]
    assert got.arrays[body["bytes"]["array"]].tobytes() == b"\x00\xff"
    assert got.arrays[body["none"]["array"]].shape == (0, 3)
    assert np.array_equal(got.arrays[body["turned"]["array"]], sent["turned"])
    assert body["deep"]["pair"][0] == "vertex"
    with pytest.raises(TypeError, match="object cannot be sent"):
        stream_of(lambda sender: sender.send("kind", {"what": object()}))


def test_a_stream_that_is_cut_anywhere_is_refused() -> None:
    def send(sender: Sender) -> None:
        sender.send("call", {"call": "add_mesh", "with": MESH, "id": 0})

    stream = stream_of(send)
    assert len(messages_of(stream)) == 1 and messages_of(b"") == []
    for end in range(1, len(stream)):
        with pytest.raises(Refused, match="a message that ends in its"):
            messages_of(stream[:end])


def described(*entry: Any) -> dict[str, Any]:
    return {"kind": "call", "body": {}, "arrays": [list(entry)]}


DEEP: Any = {}
for _ in range(200):
    DEEP = {"a": [DEEP]}


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (b"\xff\xfe", "no JSON"),
        (b"[" * 100_000, "no JSON"),
        ([], "without kind"),
        ({"kind": "call", "body": {}}, "without kind"),
        ({"kind": 1, "body": {}, "arrays": []}, "other things"),
        ({"kind": "call", "body": DEEP, "arrays": []}, "nested too deep"),
        ({"kind": "call", "body": {}, "arrays": [0] * 5000}, "5,000 arrays"),
        (described("|O", [1]), "type"),
        (described(["<f4"], [1]), "type"),
        (described("<f4", [-1]), "shape"),
        (described("<f4", [1.0]), "shape"),
        (described("<f4", [True]), "shape"),
        (described("<f4", "12"), "shape"),
        (described("<f4", [1] * 6), "shape"),
        (described("<f4", [1 << 40, 1 << 40]), "shape"),
        (described("<f4", [0, 1 << 60]), "shape"),
        (described("<f4"), "not described"),
        (described("<f4", [1], 3), "not described"),
        (described("<f4", [1], 3, 1), "not described"),
        (described("<f4", [1], -7, False), "number"),
        (described("<f4", [1], -1, True), "not described"),
        (described("<f4", [1], 3, True), "never came"),
    ],
)
def test_heads_that_are_none(what: Any, words: str) -> None:
    with pytest.raises(Refused, match=words):
        messages_of(head(what))


def test_no_memory_is_taken_for_what_is_only_announced() -> None:
    with pytest.raises(Refused, match="a head of 4,294,967,295 bytes"):
        messages_of(b"\xff\xff\xff\xff")
    with pytest.raises(MemoryError):
        messages_of(struct.pack("=I", 1 << 29), limit=1 << 20)
    with pytest.raises(MemoryError):
        messages_of(head(described("<f8", [1 << 45])), limit=1 << 30)


def test_what_is_held_is_limited_and_given_back() -> None:
    array = np.zeros(1000, np.float64)
    stream = stream_of(lambda sender: [sender.send("a", {"a": array}) for _ in range(4)])
    with pytest.raises(MemoryError):
        messages_of(stream, limit=30_000)
    receiver = receiver_of(stream, 30_000)
    for _ in range(4):
        assert receiver.receive() is not None
        receiver.give_back(array.nbytes)
    assert 0 < receiver.held < 1000, "what JSON holds stays"


def test_arrays_of_the_frame_before_are_not_sent_again() -> None:
    kept, other = np.arange(5000, dtype=np.float32), np.arange(5000, dtype=np.float32)

    def send(sender: Sender) -> None:
        for arrays in ([kept, kept], [kept], [other], [kept]):
            sender.send("a", {"a": arrays}, remember=True)
            sender.end_frame()

    stream = stream_of(send)
    assert 3 * kept.nbytes < len(stream) < 3 * kept.nbytes + 2000
    receiver = receiver_of(stream)
    for count in (2, 1, 1, 1):
        message = receiver.receive()
        assert message is not None and len(message.arrays) == count
        assert all(np.array_equal(array, kept) for array in message.arrays)
        receiver.end_frame()
        assert receiver.held == kept.nbytes, "arrays of the frame, and nothing before"


@pytest.mark.parametrize("name", ["build", "make_surfaces", "__init__", "__class__", "", "render"])
def test_only_calls_of_the_table_are_made(name: str) -> None:
    with pytest.raises(Refused, match="there is none of"):
        replay().make(call(name, {}))


MANY = np.zeros((2, 2, 2, 2), np.float32)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("add_mesh", {"positions": QUAD}),
        ("add_mesh", {**MESH, "owner": "me"}),
        ("add_mesh", {**MESH, "positions": QUAD.astype(np.float64)}),
        ("add_mesh", {**MESH, "positions": MANY}),
        ("add_mesh", {**MESH, "positions": [[0, 0, 0]]}),
        ("add_mesh", {**MESH, "positions": {"array": 7}}),
        ("add_mesh", {**MESH, "positions": {"array": -1}}),
        ("add_mesh", {**MESH, "positions": {"array": True}}),
        ("add_mesh", {**MESH, "name": 7}),
        ("add_mesh", {**MESH, "name": "\udc80"}),
        ("add_mesh", {**MESH, "material": -1}),
        ("add_mesh", {**MESH, "material": 1 << 32}),
        ("add_mesh", {**MESH, "material": 0.5}),
        ("add_mesh", {**MESH, "attributes": {"a": ["vertex"]}}),
        ("add_mesh", {**MESH, "attributes": []}),
        ("add_texture", {"pixels": np.zeros((2, 2), np.int32), "srgb": True}),
        ("add_texture", {"pixels": np.zeros((2, 2), np.uint8), "srgb": 1}),
        ("add_tiles", {"name": "a", "tiles": [[1001]], "missing": [0, 0, 0, 0]}),
        ("add_tiles", {"name": "a", "tiles": [[1001, 0]], "missing": [0]}),
        ("add_graph", {"ops": "abc", "constants": [], "images": [], "outputs": []}),
        ("add_material", {"program": "diffuse", "base_color": [0, 0]}),
        ("add_material", {"program": "diffuse", "base_color": ["0", 0, 0]}),
        ("add_material", {"program": "diffuse", "roughness": "1e999"}),
        ("add_material", {"program": "diffuse", "roughness": 10**400}),
        ("add_material", {"program": "diffuse", "textures": {"base_color": {"file": "a.png"}}}),
        ("add_material", {"program": "openpbr", "openpbr": {"fuzz_weight": {}}}),
        ("add_instances", {"parent": 0, "child": 1, "transforms": QUAD}),
        ("add_light", {"kind": "rect", "transform": np.eye(4).tolist()}),
        ("add_light", {"kind": "rect", "transform": np.eye(4), "texture": "sky.exr"}),
        ("add_geometry_set", {"rules": [["/", "expand"]]}),
        ("add_ies", {"vertical": 0, "horizontal": [0], "candela": QUAD}),
        ("set_camera", {"transform": np.eye(4), "window": [0, 1, 0]}),
        ("share_texture", {"scene": 0, "texture": 0}),
    ],
)
def test_arguments_of_another_kind_are_refused(name: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(Refused):
        replay().make(call(name, arguments, id=0))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("add_to_group", {"group": 5, "mesh": 0}),
        ("add_to_group", {"group": 0, "mesh": 0xFFFFFFFF}),
        ("replace_mesh", {"mesh": 3, "positions": QUAD, "indices": FACES}),
        ("add_mesh", {**MESH, "indices": FACES + 2}),
        ("add_mesh", {**MESH, "mesh_light": 4}),
        ("add_mesh", {**MESH, "normals": QUAD[:2]}),
        ("add_mesh", {**MESH, "attributes": {"a": ["vertex", QUAD[:1]]}}),
        ("add_curves", {"kind": "cubic-tube", "positions": QUAD, "segments": np.array([1], "<u4"),
                        "radii": np.ones(4, "<f4")}),
        ("add_points", {"positions": QUAD, "radii": np.ones(2, "<f4")}),
        ("add_instances", {"parent": 0, "child": 9, "transforms": np.eye(4)[None]}),
        ("add_instances", {"parent": 0, "child": 1, "transforms": np.eye(4)[None],
                           "names": ["a", "b"]}),
        ("add_tiles", {"name": "a", "tiles": [[1001, 9]], "missing": [0, 0, 0, 0]}),
        ("add_material", {"program": "lava"}),
        ("add_material", {"program": "diffuse", "graph": 3}),
        ("add_material", {"program": "diffuse", "textures": {"base_color": {"texture": 3}}}),
        ("add_graph", {"ops": b"\x01" * 16, "constants": [], "images": [], "outputs": [[0, 9]]}),
        ("add_light", {"kind": "rect", "transform": np.eye(4), "texture": 3}),
        ("add_light", {"kind": "sun", "transform": np.eye(4)}),
        ("add_light", {"kind": "rect", "transform": np.eye(3)}),
        ("add_ies", {"vertical": [0, 90], "horizontal": [0], "candela": QUAD}),
        ("set_camera", {"transform": np.eye(4), "window": [0, 1, 0, 1], "projection": "fish"}),
        ("add_texture", {"pixels": np.zeros((2, 2, 9), np.uint8), "srgb": True}),
        ("add_texture", {"pixels": np.zeros((0, 2, 3), np.uint8), "srgb": True}),
    ],
)  # fmt: skip
def test_ids_and_sizes_are_the_cores_to_check(name: str, arguments: dict[str, Any]) -> None:
    with pytest.raises((ValueError, WavecombError)) as caught:
        replay().make(call(name, arguments, id=0))
    assert "\n" not in str(caught.value)


def test_ids_count_up_and_a_call_fails_where_it_did() -> None:
    made = replay()
    made.make(call("add_mesh", MESH, id=0))
    with pytest.raises(Refused, match="comes to 1, not to 7"):
        made.make(call("add_mesh", MESH, id=7))
    with pytest.raises(Refused):
        replay().make(call("add_mesh", MESH))
    with pytest.raises(Refused):
        replay().make(call("add_mesh", MESH, fails=True))
    replay().make(call("add_mesh", {**MESH, "indices": FACES + 2}, fails=True))
    with pytest.raises(Refused, match="another form"):
        replay().make(call("add_mesh", MESH, id=0, evil=1))


STAGE = """#usda 1.0
(defaultPrim = "W")
def Xform "W" {
    def Mesh "Quad" {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] (
            interpolation = "vertex"
        )
    }
    def Sphere "Ball" {
        double radius = 0.5
    }
    def RectLight "Lamp" {
        color3f inputs:color = (1, 0.5, 0.25)
    }
    def PointInstancer "Many" {
        rel prototypes = [</W/Ball>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (3, 0, 0)]
    }
}
"""


def recorded(folder: Path) -> bytes:
    """What a sandbox sends of a small stage."""
    from wavecomb.run.boxed.record import RecordingBuilder
    from wavecomb.usd import load_stage

    path = folder / "s.usda"
    path.write_text(STAGE)

    def send(sender: Sender) -> None:
        factory: Any = lambda: RecordingBuilder(sender, 1, 1)  # noqa: E731
        load_stage(path, builder_factory=factory, threads=1)
        sender.send("end", {})

    return stream_of(send)


def build(stream: bytes) -> Any:
    """The scene of a stream."""
    from wavecomb import _core
    from wavecomb.run.boxed.replay import Replay

    builder = _core.SceneBuilder(1)
    making = Replay(builder, scenes={})
    for message in messages_of(stream, 1 << 28):
        if message.kind == "call":
            making.make(message)
    return builder.build()


@pytest.mark.slow
def test_flipped_bits_make_a_scene_or_an_error_and_nothing_else(tmp_path: Path) -> None:
    import wavecomb

    stream = recorded(tmp_path)
    whole = wavecomb.load(tmp_path / "s.usda", isolate=False).scene
    assert build(stream).fingerprint() == whole.fingerprint()
    chance = random.Random(19)
    outcomes = {"scene": 0, "refused": 0, "error": 0}
    for _ in range(400):
        broken = bytearray(stream)
        for _ in range(chance.choice((1, 1, 4, 64))):
            broken[chance.randrange(len(broken))] ^= 1 << chance.randrange(8)
        if chance.random() < 0.1:
            del broken[chance.randrange(len(broken)) :]
        try:
            build(bytes(broken))
            outcomes["scene"] += 1
        except Refused:
            outcomes["refused"] += 1
        except (ValueError, WavecombError, MemoryError) as error:
            assert "\n" not in str(error)
            outcomes["error"] += 1
    assert min(outcomes.values()) > 20, outcomes


def plain_meshes(count: int) -> dict[str, Any]:
    """Arguments of ``add_meshes``: quads, the last of them in no group."""
    ones = np.ones(count, np.uint32)
    groups = np.zeros(count, np.uint32)
    groups[-1] = 0xFFFFFFFF
    return {
        "positions": np.tile(QUAD, (count, 1)), "indices": np.tile(FACES, (count, 1)),
        "points": 4 * ones, "triangles": 2 * ones, "materials": 0 * ones,
        "asset_lengths": 0 * ones, "groups": groups, "names": [f"/Quad{i}" for i in range(count)],
    }  # fmt: skip


def test_small_meshes_go_over_many_at_a_time() -> None:
    from wavecomb import _core
    from wavecomb.run.boxed.record import RecordingBuilder
    from wavecomb.run.boxed.replay import Replay

    rng = np.random.default_rng(3)
    large = rng.random((4000, 3), np.float32), rng.integers(0, 4000, (50, 3)).astype(np.uint32)
    lit = {"name": "/Lit", "material": 0, "light_group": "lamps"}

    def fill(builder: Any) -> None:
        builder.add_material("diffuse", name="/White")
        group = builder.add_group("some", root="/Some")
        for i in range(1500):
            where = QUAD + np.float32(i)
            number = builder.add_mesh(where, FACES, material=0, name=f"/Q{i}", asset_length=i % 3)
            builder.add_to_group(0 if i % 2 else group, number)
            if i == 700:
                builder.add_to_group(0, builder.add_mesh(*large, material=0, name="/Large"))
                assert builder.add_mesh(QUAD, FACES, material=0, name="/Nowhere") == 702
                builder.add_to_group(0, builder.add_mesh(QUAD, FACES, **lit))
                builder.add_to_group(group, 3)  # in two groups
                with pytest.raises(ValueError, match="/Bad"):
                    builder.add_mesh(QUAD, FACES + np.uint32(2), material=0, name="/Bad")
                builder.add_instances(0, group, np.eye(4)[None])
        builder.set_camera(np.eye(4), window=(-0.5, 0.5, -0.5, 0.5))

    def send(sender: Sender) -> None:
        builder = RecordingBuilder(sender, 0)
        fill(builder)
        builder.build()

    direct, again = _core.SceneBuilder(1), _core.SceneBuilder(1)
    fill(direct)
    got = messages_of(stream_of(send))
    assert len(got) < 20, "not one for each mesh"
    made = Replay(again, scenes={})
    for message in got:
        made.make(message)
    assert direct.build().fingerprint() == again.build().fingerprint()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"points": np.full(3, 5, np.uint32)}, "do not add up"),
        ({"points": np.array([0xFFFFFFFF, 0xFFFFFFFF, 14], np.uint32)}, "do not add up"),
        ({"triangles": np.full(3, 1, np.uint32)}, "do not add up"),
        ({"points": np.array([4, 8, 0], np.uint32)}, "/Quad2"),
        ({"groups": np.full(3, 7, np.uint32)}, "group 7 was never added"),
        ({"materials": np.zeros(2, np.uint32)}, "one of each number for each name"),
        ({"names": ["/A", "/B"]}, "one of each number for each name"),
        ({"indices": np.full((6, 3), 4, np.uint32)}, "/Quad0"),
        ({"positions": np.zeros((4, 9), np.float32)}, r"positions of shape \(n, 3\)"),
    ],
)
def test_meshes_that_do_not_fit_together_are_refused(change: dict[str, Any], words: str) -> None:
    replay().make(call("add_meshes", plain_meshes(3), id=0))
    with pytest.raises(ValueError, match=words):
        replay().make(call("add_meshes", plain_meshes(3) | change, id=0))
    with pytest.raises(Refused):
        replay().make(call("add_meshes", plain_meshes(3) | {"points": np.zeros(3)}, id=0))
