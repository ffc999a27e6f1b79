# SPDX-License-Identifier: Apache-2.0
"""Tests that every schedule renders the same image, bit for bit."""

from __future__ import annotations

import itertools
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb

_core = pytest.importorskip("wavecomb._core")

OPTIONS: dict[str, list[Any]] = {
    "policy": _core.policies(),
    "materialize": ["on", "off"],
    "wave_size": [256, 4096, 65536],
    "threads": [1, 2],
    "ray_order": ["slot", "morton", "morton-octant", "direction", "auto"],
    "shadow_order": ["slot", "morton", "morton-octant", "direction", "auto"],
    "lanes": _core.lane_widths(),
    "costs": ["auto", "model"],
    "aovs": [None, ("all",), ("uv", "crypto_asset", "indirect", "light_groups")],
}
"""Settings that must not change the image."""

SCENES = ("mixed", "cornell", "textures")
ROULETTES = ("off", "throughput", "cost-aware")

_loaded: dict[str, Any] = {}
_plain: dict[Any, wavecomb.Picture] = {}


def texture_scene() -> Any:
    """Returns 24 tiles with four shading programs and a mirror. Two tiles share each texture."""
    rng = np.random.default_rng(7)
    builder = wavecomb.SceneBuilder()
    textures = [
        builder.add_texture(
            rng.integers(0, 256, (size, size, 3), np.uint8), srgb=True, name=f"noise{i}"
        )
        for i, size in enumerate((16, 512, 64, 128, 32, 256, 256, 8, 64, 512, 1024, 128))
    ]
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)

    def tile(x: float, y: float, z: float, edge: float, tiling: float, material: int) -> None:
        points = np.array([[0, 0, 0], [edge, 0, 0], [edge, edge, 0], [0, edge, 0]])
        uvs = np.array([[0, 0], [tiling, 0], [tiling, tiling], [0, tiling]], np.float32)
        mesh = builder.add_mesh(
            (points + np.array([x, y, z])).astype(np.float32), quad, uvs=uvs, material=material
        )
        builder.add_to_group(0, mesh)

    programs = ("diffuse", "plastic", "principled", "metal")
    for i in range(24):
        use = {"base_color": {"texture": textures[i % 12], "channel": "rgb"}}
        material = builder.add_material(
            programs[i % 4], name=f"Tile{i}", roughness=0.1 + 0.03 * i, textures=use
        )
        tile(2.0 * (i % 6) - 6.0, 2.0 * (i // 6) - 4.0, -4.0 - 0.01 * i, 1.98, 1.0 + i, material)
    mirror = builder.add_material("metal", name="Mirror", roughness=0.0, base_color=(0.9, 0.9, 0.9))
    tile(-10.0, -10.0, 2.5, 20.0, 1.0, mirror)
    behind = np.eye(4)
    behind[3, :3] = (1.0, 2.5, 2.0)
    builder.add_light("rect", behind, color=(9, 8, 7), width=2, height=2, name="Lamp")
    builder.add_light("dome", np.eye(4), color=(0.3, 0.4, 0.5), name="Sky")
    builder.set_camera(np.eye(4), window=(-1.5, 1.5, -1.0, 1.0))
    return builder.build()


OPENPBR_LOBES: dict[str, dict[str, Any]] = {
    "Rough": {"openpbr": {"diffuse_roughness": 0.8, "specular_weight": 0.0}},
    "Gloss": {"roughness": 0.2, "specular_color": (0.5, 0.8, 1.0)},
    "Brushed": {
        "metallic": 1.0,
        "roughness": 0.4,
        "openpbr": {"anisotropy": 0.8, "rotation": 0.15},
    },
    "Mirror": {"metallic": 1.0, "roughness": 0.0},
    "Glass": {"roughness": 0.0, "openpbr": {"transmission_weight": 1.0}},
    "Absorbing": {
        "roughness": 0.3,
        "openpbr": {
            "transmission_weight": 1.0,
            "transmission_color": (0.2, 0.8, 0.4),
            "transmission_depth": 0.5,
        },
    },
    "Wall": {
        "openpbr": {
            "thin_walled": True,
            "transmission_weight": 0.5,
            "subsurface_weight": 0.6,
            "subsurface_anisotropy": 0.2,
        }
    },
    "Coat": {
        "clearcoat": 0.9,
        "clearcoat_roughness": 0.3,
        "openpbr": {"coat_color": (0.9, 0.5, 0.3)},
    },
    "Varnish": {"clearcoat": 1.0, "clearcoat_roughness": 0.0, "roughness": 0.5},
    "Film": {"roughness": 0.1, "openpbr": {"film_weight": 1.0, "film_thickness": 350.0}},
    "Fuzz": {"openpbr": {"fuzz_weight": 1.0, "fuzz_color": (0.9, 0.6, 0.6)}},
    "All": {
        "metallic": 0.3,
        "roughness": 0.4,
        "clearcoat": 0.6,
        "clearcoat_roughness": 0.2,
        "emission": (0.1, 0.0, 0.0),
        "openpbr": {
            "transmission_weight": 0.4,
            "fuzz_weight": 0.5,
            "film_weight": 0.5,
            "subsurface_weight": 0.5,
            "anisotropy": 0.3,
        },
    },
}
"""Maps names to materials: one for each lobe of OpenPBR, and one with all lobes."""


def openpbr_scene() -> Any:
    """Returns closed boxes in front of a wall, one for each of ``OPENPBR_LOBES``."""
    builder = wavecomb.SceneBuilder()
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)), np.float32)
    faces = [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    turned = np.linalg.qr(np.array([[2.0, 1.0, 0.5], [-1.0, 2.0, 0.7], [0.3, -0.8, 2.0]]))[0]
    turned *= np.sign(np.linalg.det(turned))
    for i, (name, values) in enumerate(OPENPBR_LOBES.items()):
        material = builder.add_material("openpbr", name=name, base_color=(0.8, 0.7, 0.5), **values)
        points = corners @ turned.T + np.array([1.5 * (i % 4) - 2.25, 1.5 * (i // 4) - 1.5, -8.0])
        mesh = builder.add_mesh(
            points.astype(np.float32), np.array(faces, np.uint32), material=material
        )
        builder.add_to_group(0, mesh)
    grey = builder.add_material("diffuse", name="Grey", base_color=(0.6, 0.6, 0.6))
    back = np.array([[-9, -9, -9.5], [9, -9, -9.5], [9, 9, -9.5], [-9, 9, -9.5]], np.float32)
    builder.add_to_group(
        0, builder.add_mesh(back, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), material=grey)
    )
    builder.add_light("dome", np.eye(4), color=(0.4, 0.5, 0.6), name="Sky")
    lamp = np.eye(4)
    lamp[3, :3] = (1.0, 3.0, 0.0)
    builder.add_light("sphere", lamp, color=(40, 38, 35), radius=0.5, name="Lamp")
    builder.set_camera(np.eye(4), window=(-0.45, 0.45, -0.3, 0.3))
    return builder.build()


def graph_scene() -> Any:
    """Returns tiles with parameters driven by the same or different graphs; one tile emits."""
    from wavecomb.usd.graphs.values import PARAMETERS, Expressions, assemble, numbers

    builder = wavecomb.SceneBuilder()
    texels = np.random.default_rng(2).integers(0, 256, (64, 64, 3), np.uint8)
    texture = builder.add_texture(texels, srgb=True, name="noise")

    def graph(**driven: Any) -> int:
        parts: dict[int, Any] = {}
        for name, value in driven.items():
            first, width = PARAMETERS[name]
            assert len(value) == width
            parts |= {first + i: part for i, part in enumerate(value)}
        made = assemble(parts)
        return int(builder.add_graph(made.ops, made.constants, made.images, made.outputs))

    e = Expressions()
    place, uv = e.input("local_position"), e.input("uv")
    noise = e.op("noise3", e.op("multiply", place, numbers(3.0)), width=3)
    bright = e.op("add", e.op("multiply", noise, numbers(0.5)), numbers(0.5))
    texel = e.image(texture, e.op("multiply", uv, numbers(3.0)), 3.0)
    facing = e.op("abs", e.op("dot", e.input("view"), e.input("normal")))
    glow = e.op("multiply", e.op("worley2", uv, numbers(1.0), width=1), numbers(2.0))
    tilted = (*e.op("multiply", noise[:2], numbers(0.3)), 1.0)
    fractal = e.op("fractal3", place, numbers(2.0), numbers(0.5), number=3, width=1)
    holes = graph(opacity=e.op("less", fractal, numbers(0.1)))
    kinds: list[dict[str, Any]] = [
        {"graph": graph(base_color=bright, roughness=bright[:1], fuzz_weight=bright[1:2])},
        {"graph": graph(base_color=texel[:3], metallic=facing, normal=tilted)},
        {"graph": holes, "opacity_graph": holes, "presence": True},
        {"graph": graph(film_thickness=e.op("multiply", bright[:1], numbers(900.0)),
                        film_weight=numbers(1.0), coat_ior=bright[1:2], anisotropy=bright[2:])},
        {"base_color": (0.2, 0.6, 0.3)},
    ]  # fmt: skip
    shining = graph(emission=glow * 3)
    kinds.append({"graph": shining, "emission_graph": shining})
    materials = [
        builder.add_material("openpbr" if i % 2 == 0 else "principled", name=f"G{i}", **kind)
        for i, kind in enumerate([*kinds, *kinds])
    ]
    quad = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    for i in range(48):
        place_of = np.array([i % 8 - 4.0, i // 8 - 3.0, -6.0 - 0.3 * (i % 5)], np.float32)
        mesh = builder.add_mesh(
            quad + place_of, faces, uvs=quad[:, :2].copy(), material=materials[(5 * i) % 12]
        )
        builder.add_to_group(0, mesh)
    builder.add_light("dome", np.eye(4), color=(0.4, 0.5, 0.6), name="Sky")
    builder.set_camera(np.eye(4), window=(-0.6, 0.6, -0.4, 0.4))
    return builder.build()


@pytest.fixture(scope="session")
def scene_of(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Returns a function that returns a scene by name and creates each scene once."""

    def scene(name: str) -> Any:
        if name not in _loaded:
            if name == "textures":
                _loaded[name] = texture_scene()
            elif name == "openpbr":
                _loaded[name] = openpbr_scene()
            elif name == "graphs":
                _loaded[name] = graph_scene()
            else:
                from wavecomb.scenes import write_scene

                path: Path = tmp_path_factory.mktemp("stages") / f"{name}.usdc"
                write_scene(name, path, triangles=20_000, teapot_level=8, texture_size=256)
                _loaded[name] = wavecomb.load(path)
        return _loaded[name]

    return scene


def render(scene: Any, size: tuple[int, int], spp: int, **settings: Any) -> wavecomb.Picture:
    return wavecomb.render(scene, size=size, spp=spp, seed=3, **settings)


def expect_equal(a: wavecomb.Picture, b: wavecomb.Picture, what: Any) -> None:
    layers_a, layers_b = a.layers(), b.layers()
    common = [name for name in layers_a if name in layers_b and name != "cost"]  # a measured time
    assert len(common) == min(len(layers_a), len(layers_b)) - ("cost" in {*layers_a} & {*layers_b})
    for layer in common:
        same = layers_a[layer].tobytes() == layers_b[layer].tobytes()
        assert same, f"{layer} differs: {what}"
    for count in ("samples", "rays", "shadow_rays", "records"):
        assert a.stats["counts"][count] == b.stats["counts"][count], f"{count} differ: {what}"


def plain(
    scene_of: Any, scene: str, roulette: str, size: tuple[int, int], spp: int
) -> wavecomb.Picture:
    """Renders the reference image: arrival order, one thread, all AOVs."""
    key = (scene, roulette, size, spp)
    if key not in _plain:
        _plain[key] = render(
            scene_of(scene), size, spp, roulette=roulette, policy="none", threads=1, costs="model",
            aovs=("all",),
        )  # fmt: skip
    return _plain[key]


def covering_rows(options: dict[str, list[Any]], seed: int = 1) -> list[dict[str, Any]]:
    """Returns a few combinations of options that include every pair of values of two options."""
    rng = random.Random(seed)
    names = list(options)
    left = {
        ((a, x), (b, y))
        for a, b in itertools.combinations(names, 2)
        for x in options[a]
        for y in options[b]
    }

    def gain(row: dict[str, Any]) -> int:
        return sum(((a, row[a]), (b, row[b])) in left for a, b in itertools.combinations(names, 2))

    rows: list[dict[str, Any]] = []
    while left:
        (a, x), (b, y) = min(left, key=repr)
        tries = [
            {name: rng.choice(values) for name, values in options.items()} | {a: x, b: y}
            for _ in range(60)
        ]
        best = max(tries, key=gain)
        left -= {((a, best[a]), (b, best[b])) for a, b in itertools.combinations(names, 2)}
        rows.append(best)
    return rows


COVERING = covering_rows({**OPTIONS, "scene": list(SCENES), "roulette": list(ROULETTES)})


def test_covering_design_covers() -> None:
    options = {**OPTIONS, "scene": list(SCENES), "roulette": list(ROULETTES)}
    for a, b in itertools.combinations(options, 2):
        assert {(repr(row[a]), repr(row[b])) for row in COVERING} == {
            (repr(x), repr(y)) for x in options[a] for y in options[b]
        }
    assert len(COVERING) < 80


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_scenes_have_something_to_order(scene: str, scene_of: Any) -> None:
    stats = plain(scene_of, scene, "off", (48, 32), 8).stats
    counts = stats["counts"]
    assert counts["records"] > 1.5 * counts["samples"]
    assert counts["shadow_rays"] > 0.2 * counts["records"]
    used = [material for material in stats["materials"] if material["records"]]
    assert len(used) >= {"mixed": 8, "cornell": 3, "textures": 25}[scene]
    if scene != "cornell":
        assert len({material["program"] for material in used}) >= 4
        assert stats["lane_utilisation"] < 0.7


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_coherence_is_of_all_depths(scene: str, scene_of: Any) -> None:
    """Coherence is measured at all depths, so one more depth hardly changes the coherence."""
    settings: dict[str, Any] = {
        "policy": "material",
        "threads": 1,
        "wave_size": 256,
        "costs": "model",
    }
    lengths = [
        render(scene_of(scene), (192, 128), 16, max_depth=depth, roulette="off", **settings).stats[
            "coherence"
        ]["run_length"]
        for depth in (7, 8)
    ]
    assert lengths[0] == pytest.approx(lengths[1], rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_every_pair_of_options(scene: str, scene_of: Any) -> None:
    for row in COVERING:
        if row["scene"] != scene:
            continue
        settings = {name: value for name, value in row.items() if name != "scene"}
        expected = plain(scene_of, scene, row["roulette"], (48, 32), 8)
        expect_equal(render(scene_of(scene), (48, 32), 8, **settings), expected, row)


SMALL = (16, 12), [256, 1024, 65536]
LARGE = (32, 24), OPTIONS["wave_size"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "roulette", "size", "waves"),
    [
        *((scene, roulette, *SMALL) for scene, roulette in zip(SCENES, ROULETTES, strict=True)),
        *(
            pytest.param(scene, roulette, *LARGE, marks=pytest.mark.long)
            for scene, roulette in itertools.product(SCENES, ROULETTES)
        ),
    ],
)
def test_every_choice(
    scene: str, roulette: str, size: tuple[int, int], waves: list[int], scene_of: Any
) -> None:
    """All combinations of options render the same image, with many waves or one per thread."""
    spp = 8
    expected = plain(scene_of, scene, roulette, size, spp)
    names = ("policy", "materialize", "wave_size", "threads", "ray_order")
    for choice in itertools.product(*({**OPTIONS, "wave_size": waves}[name] for name in names)):
        settings = dict(zip(names, choice, strict=True))
        settings |= {"roulette": roulette, "costs": "model", "shadow_order": settings["ray_order"]}
        expect_equal(render(scene_of(scene), size, spp, **settings), expected, settings)


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_what_a_stage_keeps_does_not_show(scene: str, scene_of: Any) -> None:
    """A loaded stage reuses its BVH and light calibration.

    The reused data equals the data of a new render.
    """
    stage = scene_of(scene)
    alone = getattr(stage, "scene", stage)
    for threads in (1, 2, 5):
        render(stage, (20, 16), 2, max_depth=3, threads=2)
        kept = render(stage, (32, 24), 8, roulette="off", threads=threads, costs="model")
        new = render(alone, (32, 24), 8, roulette="off", threads=threads, costs="model")
        expect_equal(kept, new, threads)
        expect_equal(kept, plain(scene_of, scene, "off", (32, 24), 8), threads)


def test_a_stage_does_not_keep_what_was_edited(scene_of: Any) -> None:
    stage = scene_of("cornell")
    with stage.renderer() as (renderer, _):
        renderer.edit(materials={0: {"emission": (1, 2, 3)}})
    picture = render(stage, (32, 24), 8, roulette="off", costs="model")
    expect_equal(picture, plain(scene_of, "cornell", "off", (32, 24), 8), "edited")
    with stage.renderer() as (renderer, is_new):
        assert not is_new and renderer.scene is stage.scene


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_full_waves_of_64_k(scene: str, scene_of: Any) -> None:
    size, spp = (128, 128), 16
    expected = plain(scene_of, scene, "cost-aware", size, spp)
    assert expected.stats["wave_size"] == 4096
    for i, policy in enumerate(OPTIONS["policy"]):
        order = OPTIONS["ray_order"][i % 5]
        picture = render(
            scene_of(scene), size, spp, policy=policy, threads=1, wave_size=65536,
            ray_order=order, shadow_order=order, materialize="on" if i % 2 else "off",
            roulette="cost-aware",
        )  # fmt: skip
        assert picture.stats["wave_size"] == 65536
        expect_equal(picture, expected, (policy, order))


class Shuffled(wavecomb.SchedulingPolicy):
    """A scheduling policy that gives random sorting keys to queued hits."""

    name = "shuffled"

    def order(self, queue: Any, costs: Any, keys: Any) -> None:
        keys[:] = np.random.default_rng(keys.size).integers(0, 1 << 63, keys.size)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.slow
def test_a_senseless_order_gives_the_same_picture(scene: str, scene_of: Any) -> None:
    for roulette in ROULETTES:
        picture = render(
            scene_of(scene), (48, 32), 8, policy=Shuffled(), roulette=roulette, costs="model"
        )
        expect_equal(picture, plain(scene_of, scene, roulette, (48, 32), 8), roulette)


def test_all_lobes_of_openpbr_are_one_picture(scene_of: Any) -> None:
    scene, size = scene_of("openpbr"), (48, 32)
    expected = render(scene, size, 8, integrator="reference", threads=1)
    assert np.isfinite(expected.beauty).all() and expected.beauty.mean() > 0.05
    widths = _core.lane_widths()
    for lanes, policy, threads in itertools.product(
        (widths[0], widths[-1]), ("none", "material"), (1, 2)
    ):
        picture = render(scene, size, 8, lanes=lanes, policy=policy, threads=threads, wave_size=256)
        same = picture.beauty.tobytes() == expected.beauty.tobytes()
        assert same, (lanes, policy, threads)
    used = {material["name"] for material in picture.stats["materials"] if material["records"]}
    assert used >= set(OPENPBR_LOBES)


def test_value_graphs_are_one_picture(scene_of: Any) -> None:
    scene, size = scene_of("graphs"), (48, 32)
    expected = render(scene, size, 8, integrator="reference", threads=1)
    assert np.isfinite(expected.beauty).all() and expected.beauty.std() > 0.05
    widths, policies = _core.lane_widths(), ("none", "material", "texture", "random-runs")
    for i, (lanes, policy) in enumerate(itertools.product(widths, policies)):
        picture = render(
            scene, size, 8, lanes=lanes, policy=policy, threads=1 + i % 2,
            wave_size=(256, 4096)[i // 2 % 2], materialize=("on", "off")[i // 3 % 2],
        )  # fmt: skip
        same = picture.beauty.tobytes() == expected.beauty.tobytes()
        assert same, (lanes, policy)
    used = {material["name"] for material in picture.stats["materials"] if material["records"]}
    assert used >= {f"G{i}" for i in range(12)}


def test_roulettes_are_different_estimates(scene_of: Any) -> None:
    pictures = [plain(scene_of, "cornell", roulette, (48, 32), 8) for roulette in ROULETTES]
    for a, b in itertools.combinations(pictures, 2):
        assert not np.array_equal(a.beauty, b.beauty)


@pytest.mark.slow
def test_cost_aware_from_one_profile_is_reproducible(scene_of: Any) -> None:
    """With costs from a profile, runs are reproducible; measured costs would vary between runs."""
    scene = scene_of("mixed")
    costs = render(scene, (48, 32), 8, policy="adaptive").costs
    settings = {"roulette": "cost-aware", "costs": costs}
    first = render(scene, (48, 32), 40, policy="adaptive", threads=2, **settings)
    again = render(scene, (48, 32), 40, policy="none", threads=1, wave_size=256, **settings)
    expect_equal(again, first, "profile")
    other = render(scene, (48, 32), 40, roulette="cost-aware", costs="model")
    assert not np.array_equal(other.beauty, first.beauty), "the profile decides"
