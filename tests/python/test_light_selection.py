# SPDX-License-Identifier: Apache-2.0
"""Tests light selection by tree: unchanged mean, less noise, equal images for all schedules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb import _core
from wavecomb.scenes import SceneError, write_scene

SIZE = (32, 24)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path: Path = tmp_path_factory.mktemp("street") / "street.usdc"
    write_scene("lights", path, lights=200)
    return wavecomb.load(path).scene


def builder_scene(
    glass: bool = False, edit: dict[int, dict[str, Any]] | None = None
) -> wavecomb.SceneBuilder:
    """Returns a room of many small lights under a dome, optionally with a rough glass pane."""
    rng = np.random.default_rng(4)
    builder = wavecomb.SceneBuilder()
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)

    def plane(points: Any, material: int) -> None:
        builder.add_to_group(
            0, builder.add_mesh(np.array(points, np.float32), quad, material=material)
        )

    white = builder.add_material("diffuse", name="White", base_color=(0.7, 0.7, 0.7))
    shiny = builder.add_material("metal", name="Shiny", roughness=0.3, base_color=(0.9, 0.8, 0.6))
    plane([[-4, -1, -8], [4, -1, -8], [4, -1, 0], [-4, -1, 0]], white)
    plane([[-4, -1, -8], [-4, 3, -8], [4, 3, -8], [4, -1, -8]], shiny)
    if glass:
        pane = builder.add_material("dielectric", name="Glass", roughness=0.2)
        plane([[-1, -1, -3], [1, -1, -3], [1, 1, -3], [-1, 1, -3]], pane)
    for i in range(30):
        at = np.eye(4)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        at[:3, :3] = turn
        at[3, :3] = rng.uniform([-4, -0.9, -7.9], [4, 3, -1])
        kind = ("rect", "disk", "sphere")[i % 3]
        color = tuple(float(v) for v in rng.uniform(1, 20, 3))
        values = {"transform": at, "color": color, "width": 0.2, "height": 0.3, "radius": 0.15}
        values |= (edit or {}).get(i, {})
        builder.add_light(kind, name=f"L{i}", group=f"g{i % 3}", **values)
    builder.add_light("dome", np.eye(4), color=(0.02, 0.03, 0.05), name="Sky")
    glow = builder.add_material("emissive", name="Glow", emission=(4, 2, 1))
    for x in np.linspace(-3, 3, 7):
        plane([[x, 0, -6], [x + 0.2, 0, -6], [x + 0.2, 0.3, -5.8], [x, 0.3, -5.8]], glow)
    builder.set_camera(np.eye(4), window=(-0.8, 0.8, -0.6, 0.6))
    return builder


def render(scene: Any, selection: str, seed: int = 0, spp: int = 16, **more: Any) -> Any:
    return wavecomb.render(scene, size=SIZE, spp=spp, seed=seed, light_selection=selection, **more)


@pytest.mark.slow
@pytest.mark.parametrize("glass", [False, True])
def test_the_mean_is_that_of_power(glass: bool) -> None:
    scene = builder_scene(glass).build()
    runs = 24
    stacks = {
        selection: np.array(
            [render(scene, selection, seed, 32, max_depth=3).beauty for seed in range(runs)],
            np.float64,
        )
        for selection in ("power", "tree")
    }
    # Means over blocks of 8 x 8 pixels are close to normally distributed.
    blocks = {k: v.reshape(runs, 3, 8, 4, 8, 3).mean(axis=(2, 4, 5)) for k, v in stacks.items()}
    a, b = blocks["power"], blocks["tree"]
    z = (a.mean(0) - b.mean(0)) / np.sqrt((a.var(0, ddof=1) + b.var(0, ddof=1)) / runs)
    assert np.abs(z).max() < 4.5, z
    assert np.sqrt((z**2).mean()) < 1.8, z
    totals = {k: v.mean(axis=(1, 2, 3)) for k, v in stacks.items()}
    difference = totals["tree"].mean() - totals["power"].mean()
    error = np.sqrt(sum(t.var(ddof=1) for t in totals.values()) / runs)
    assert abs(difference) < 4 * error
    assert error < 0.01 * totals["power"].mean()


@pytest.mark.slow
def test_the_tree_has_less_noise(street: Any) -> None:
    # The noise of directly visible lights does not depend on the selection.
    def lit(selection: str, seed: int, spp: int) -> Any:
        return render(street, selection, seed, spp, max_depth=2, aovs=["direct"]).aovs["direct"]

    truth = lit("tree", 99, 2048)
    errors = {
        selection: np.mean([((lit(selection, s, 16) - truth) ** 2).mean() for s in range(3)])
        for selection in ("power", "tree")
    }
    assert errors["tree"] < 0.5 * errors["power"], errors


def test_auto_takes_the_tree_where_lights_are_many(street: Any) -> None:
    pictures = {s: render(street, s).beauty.tobytes() for s in ("auto", "tree", "power")}
    assert pictures["auto"] == pictures["tree"] != pictures["power"]


@pytest.mark.parametrize("glass", [False, True])
def test_one_picture_for_all_schedules(glass: bool) -> None:
    scene = builder_scene(glass).build()
    expected = render(scene, "tree", integrator="reference").beauty
    assert np.isfinite(expected).all() and expected.mean() > 0.01
    for i, lanes in enumerate(_core.lane_widths()):
        picture = render(
            scene, "tree", lanes=lanes, wave_size=(64, 4096)[i % 2], threads=1 + i % 2,
            policy=("none", "material", "texture-locality")[i % 3],
            ray_order=("slot", "morton")[i % 2],
        )  # fmt: skip
        assert picture.beauty.tobytes() == expected.tobytes(), lanes


def test_light_groups_follow_the_choice() -> None:
    """Light groups add up to the beauty, and each group equals a render with its lights alone."""
    scene = builder_scene().build()
    picture = render(scene, "tree", spp=64, aovs=["light_groups"])
    groups = {name: layer for name, layer in picture.aovs.items() if name.startswith("light_")}
    assert sorted(groups) == ["light_g0", "light_g1", "light_g2", "light_other"]
    total = sum(layer.astype(np.float64) for layer in groups.values())
    assert total == pytest.approx(picture.beauty, rel=1e-4, abs=1e-5)
    by_power = render(scene, "power", spp=64, aovs=["light_groups"]).aovs
    for name, layer in groups.items():
        assert layer.mean() == pytest.approx(by_power[name].mean(), rel=0.1), name


def test_edited_lights_make_another_tree() -> None:
    moved = np.eye(4)
    moved[3, :3] = 1, 1, -4
    settings = wavecomb.Settings(width=32, height=24, spp=4, light_selection="tree")
    renderer = _core.Renderer(builder_scene().build())
    before = renderer.render(settings).beauty.tobytes()
    for edit in (
        {2: {"transform": moved, "color": (90.0, 80.0, 70.0)}},
        {2: {"color": (0.0, 0.0, 0.0)}},
    ):
        renderer = _core.Renderer(builder_scene().build())
        renderer.render(settings)
        renderer.edit(lights=edit)
        anew = _core.Renderer(builder_scene(edit=edit).build())
        edited = renderer.render(settings).beauty.tobytes()
        assert edited == anew.render(settings).beauty.tobytes() != before


def test_the_setting_is_told(street: Any) -> None:
    assert render(street, "tree").stats["settings"]["light_selection"] == "tree"
    with pytest.raises(_core.Error, match="light_selection"):
        render(street, "best")


def test_the_street_has_the_lights_that_were_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "street.usda"
    write_scene("lights", path, lights=25)
    text = path.read_text()
    for kind in ("RectLight", "DiskLight", "SphereLight"):
        assert text.count(f"def {kind} ") == 5
    assert text.count('def Mesh "Sign_') == 5 == text.count('def Mesh "Strip_')
    with pytest.raises(SceneError, match="lights must be from 1"):
        write_scene("lights", path, lights=0)


def test_a_tree_that_nobody_chooses_by_is_not_built() -> None:
    """By default, one bright light and many faint ones are selected by power."""

    def scene() -> wavecomb.Scene:
        rng = np.random.default_rng(6)
        builder = wavecomb.SceneBuilder()
        floor = np.array([[-4, -1, -8], [4, -1, -8], [4, -1, 0], [-4, -1, 0]], np.float32)
        quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
        white = builder.add_material("diffuse", name="White", base_color=(0.7, 0.7, 0.7))
        builder.add_to_group(0, builder.add_mesh(floor, quad, material=white))
        at = rng.uniform([-3, 0, -7], [3, 2, -2], (5000, 1, 3))
        dust = (at + rng.uniform(-0.02, 0.02, (5000, 3, 3))).reshape(-1, 3).astype(np.float32)
        faces = np.arange(len(dust), dtype=np.uint32).reshape(-1, 3)
        glow = builder.add_material("emissive", name="Glow", emission=(2, 2, 2))
        builder.add_to_group(0, builder.add_mesh(dust, faces, material=glow))
        lamp = np.eye(4)
        lamp[3, :3] = 0, 3, -4
        builder.add_light("sphere", lamp, color=(9000, 9000, 9000), radius=0.5)
        builder.set_camera(np.eye(4), window=(-0.8, 0.8, -0.6, 0.6))
        return builder.build()

    def render(of: wavecomb.Scene, how: str) -> wavecomb.Picture:
        return wavecomb.render(of, size=SIZE, spp=4, light_selection=how)

    one, other = scene(), scene()
    power = render(one, "power")
    before = power.stats["memory_bytes"]["records"]
    assert wavecomb.compare(render(one, "auto"), power).equal
    tree = render(one, "tree")
    assert tree.stats["memory_bytes"]["records"] - before >= 5000 * 64
    assert not wavecomb.compare(tree, power).equal
    assert wavecomb.compare(render(other, "tree"), tree).equal, "whenever it is built"
    assert wavecomb.compare(render(one, "power"), power).equal
