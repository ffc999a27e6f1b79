# SPDX-License-Identifier: Apache-2.0
"""Tests scenes with a known answer, from USD text through loader and renderer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from stages import (
    box,
    camera,
    ground,
    latlong_directions,
    light,
    look_at,
    material,
    moved,
    quad,
    sky,
    sphere,
    turned,
    write_sky,
    write_stage,
)

import wavecomb

SIZE, SPP = 24, 1024
INSIDE = slice(10, 14)
"""Pixels in the middle of the image."""


@pytest.fixture
def shot(tmp_path: Path, beauty: Any) -> Any:
    """Function that renders prims."""

    def render(*prims: str, size: int = SIZE, spp: int = SPP, **settings: Any) -> Any:
        stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
        return beauty(stage, size, spp, **settings)

    return render


# ---- white furnace -------------------------------------------------------------------------------

AT_BALL = camera((0, 0, 6), (0, 0, 0), half=0.1)
WHITE = light("Dome")


def test_diffuse_furnace_with_all_bounces(shot: Any) -> None:
    """A white diffuse body under radiance 1 from all sides has radiance 1.

    A faceted ball receives only the dome's light, so one bounce is sufficient.
    """
    picture = shot(
        AT_BALL, WHITE, material("M", "diffuse", diffuseColor=(1, 1, 1)), sphere("B", "M")
    )
    assert abs(picture.mean() - 1.0) < 1e-3


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("tilt", [(0.7, 0.0), (-0.7, 0.0), (0.0, 0.7), (0.5, -0.6)])
def test_mirrors_with_tilted_normals_see_the_sky(
    shot: Any, tilt: tuple[float, float], behind: bool
) -> None:
    """A mirror under a uniform dome has radiance 1 for any normal map.

    At 80 degrees the unadjusted normal would reflect rays below the surface.
    """
    normal = (*tilt, float(np.sqrt(1.0 - np.hypot(*tilt) ** 2)))
    mirror = material(
        *("M", "metal"), diffuseColor=(1, 1, 1), metallic=1.0, roughness=0.0, normal=normal
    )
    height = -np.cos(np.radians(80.0)) if behind else np.cos(np.radians(80.0))
    eye = (6 * np.sin(np.radians(80.0)), 6 * height, 0.0)
    floor = [(-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4)]
    uv = [(0, 0), (1, 0), (1, 1), (0, 1)]
    picture = shot(
        *(camera(eye, (0, 0, 0), half=0.02), WHITE, mirror, quad("Floor", floor, "M", uv=uv)),
        spp=16,
    )
    assert np.abs(picture - 1.0).max() < 1e-3


def test_grey_furnace(shot: Any) -> None:
    """A body of albedo a under uniform radiance 1 has radiance a."""
    albedo = np.array((0.8, 0.5, 0.2))
    body = material("M", "diffuse", diffuseColor=tuple(albedo))
    picture = shot(AT_BALL, WHITE, body, sphere("B", "M"))
    assert np.abs(picture[INSIDE, INSIDE].mean(axis=(0, 1)) / albedo - 1.0).max() < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize("roulette", ["off", "throughput"])
def test_integrating_sphere(shot: Any, roulette: str) -> None:
    """A point light of intensity I at the centre of a diffuse cavity of radius R and albedo a.

    The form factor between any two points of a sphere is the same, so radiance is uniform. With E =
    I / R^2: a E / pi (1 + a + a^2 ...) = a I / (pi R^2 (1 - a)).
    """
    albedo = np.array((0.9, 0.6, 0.3))
    walls = material("M", "diffuse", diffuseColor=tuple(albedo))
    lamp = light("Sphere", colour=(40, 40, 40), radius=0.0)  # I = 40 / 4
    view = camera((0.5, -0.3, 0.4), (-0.7, 0.2, -1.0))
    picture = shot(view, walls, lamp, sphere("B", "M", radius=2.0, rings=96), size=16, spp=256,
                   max_depth=80, roulette=roulette)  # fmt: skip
    expected = albedo * 10.0 / (np.pi * 4.0 * (1.0 - albedo))
    assert np.abs(picture.mean(axis=(0, 1)) / expected - 1.0).max() < 5e-3
    # Uniform as well.
    assert np.abs(picture.reshape(4, 4, 4, 4, 3).mean(axis=(1, 3)) / expected - 1.0).max() < 0.06


PROGRAMS: dict[str, dict[str, Any]] = {
    "diffuse": {"diffuseColor": (1, 1, 1)},
    "metal": {"diffuseColor": (1, 1, 1)},
    "plastic": {"diffuseColor": (1, 1, 1)},
    "dielectric": {"diffuseColor": (1, 1, 1)},
    "principled": {"diffuseColor": (1, 1, 1)},
}


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("program", PROGRAMS)
def test_no_program_makes_energy(shot: Any, program: str, roughness: float) -> None:
    """In a white furnace, the radiance is between 1 minus the program's known loss and 1."""
    body = material("M", program, roughness=roughness, **PROGRAMS[program])
    depth = 32 if program == "dielectric" else 1
    picture = shot(AT_BALL, WHITE, body, sphere("B", "M"), spp=512, size=16, max_depth=depth)
    mean = picture.mean()
    # Rough glass loses multiple scattering between microfacets (tests/cpp compares a single
    # interface with the integral). The mean radiance of a ball of roughness 1 is 0.36, and 0.35 in
    # Mitsuba, because light crosses two or more interfaces that model single scattering only.
    lowest = {"diffuse": 0.999, "metal": 0.97, "dielectric": 0.35 if roughness > 0.6 else 0.74}
    assert lowest.get(program, 0.99) < mean < 1.003, f"{program} {roughness}: {mean:.4f}"


def test_clearcoat_makes_no_energy(shot: Any) -> None:
    body = material("M", "principled", diffuseColor=(1, 1, 1), clearcoat=1.0, roughness=0.5)
    assert 0.85 < shot(AT_BALL, WHITE, body, sphere("B", "M"), max_depth=1).mean() < 1.003


def test_smooth_glass_keeps_all_energy(shot: Any) -> None:
    """Furnace test of smooth glass: the scaling 1 / eta^2 cancels when paths leave the glass."""
    body = material("M", "dielectric", diffuseColor=(1, 1, 1), roughness=0.0, ior=1.5)
    picture = shot(AT_BALL, WHITE, body, sphere("B", "M", rings=48, smooth=True), max_depth=200)
    assert abs(picture.mean() - 1.0) < 2e-3


# ---- irradiance ----------------------------------------------------------------------------------

FLOOR = material("M", "diffuse", diffuseColor=(0.5, 0.5, 0.5))
DOWN = camera((0, 5, 0), (0, 0, 0), half=0.004)
"""A camera above the floor that sees 4 cm around the origin."""


def floor_radiance(shot: Any, *lights: str) -> NDArray[np.float64]:
    return shot(DOWN, FLOOR, ground("M"), *lights, max_depth=1, spp=2048).mean(axis=(0, 1))


@pytest.mark.parametrize("angle", [0.0, 0.53, 20.0])
def test_distant_light(shot: Any, angle: float) -> None:
    """A normalised distant light has irradiance E at normal incidence, and here E cos(40°).

    The mean cosine over a cone above the horizon is the cosine of the cone's axis.
    """
    sun = light(
        "Distant", colour=(2, 1, 3), transform=turned(-90 + 40), angle=angle, normalize=True
    )
    expected = 0.5 / np.pi * np.array((2, 1, 3)) * np.cos(np.radians(40))
    assert np.abs(floor_radiance(shot, sun) / expected - 1.0).max() < 5e-3


def test_distant_light_not_normalized(shot: Any) -> None:
    """A distant light of radiance L has the irradiance pi L sin^2(half angle)."""
    sun = light("Distant", colour=(2, 1, 3), transform=turned(-90), angle=30.0)
    expected = 0.5 * np.array((2, 1, 3)) * np.sin(np.radians(15)) ** 2
    assert np.abs(floor_radiance(shot, sun) / expected - 1.0).max() < 5e-3


def test_sphere_light(shot: Any) -> None:
    """Sphere at height h with radius r, entirely visible from the floor: E = pi L (r / d)^2 cos."""
    lamp = light("Sphere", colour=(8, 4, 2), transform=moved(1.5, 2.0, 0), radius=0.5)
    d2 = 1.5**2 + 2.0**2
    expected = 0.5 * np.array((8, 4, 2)) * 0.25 / d2 * (2.0 / np.sqrt(d2))
    assert np.abs(floor_radiance(shot, lamp) / expected - 1.0).max() < 5e-3


def test_disk_light(shot: Any) -> None:
    """A disk of radius r at height h has the irradiance pi L r^2 / (r^2 + h^2) below its centre."""
    lamp = light("Disk", colour=(8, 4, 2), transform=turned(-90) @ moved(0, 3, 0), radius=1.0)
    # The camera starts below the disk, so that its rays do not hit the disk.
    below = camera((0, 2.5, 0), (0, 0, 0), half=0.004)
    picture = shot(below, FLOOR, ground("M"), lamp, max_depth=1, spp=2048).mean(axis=(0, 1))
    expected = 0.5 * np.array((8, 4, 2)) / 10.0
    assert np.abs(picture / expected - 1.0).max() < 5e-3


def test_rect_light(shot: Any) -> None:
    """A rect light with a corner overhead: form factor of a parallel rectangle (Howell's B-3)."""
    a, b, h = 1.2, 0.7, 2.0
    place = turned(-90) @ moved(a / 2, h, b / 2)
    lamp = light("Rect", colour=(8, 4, 2), transform=place, width=a, height=b)
    below = camera((0, 1.5, 0), (0, 0, 0), half=0.004)
    x, y = a / h, b / h
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    factor = (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi)
    picture = shot(below, FLOOR, ground("M"), lamp, max_depth=1, spp=2048).mean(axis=(0, 1))
    assert np.abs(picture / (0.5 * np.array((8, 4, 2)) * factor) - 1.0).max() < 5e-3


def test_rect_light_shines_one_way(shot: Any) -> None:
    """A rect light emits along -z and is black at the back."""
    up = light("Rect", transform=turned(90) @ moved(0, 2, 0), width=1, height=1)
    below = camera((0, 1.5, 0), (0, 0, 0), half=0.004)
    assert shot(below, FLOOR, ground("M"), up, max_depth=3, spp=16).max() == 0.0
    assert shot(camera((0, 5, 0), (0, 0, 0), half=0.01), up, spp=4).mean() == pytest.approx(1.0)
    assert shot(camera((0, -5, 0), (0, 0, 0), half=0.01), up, spp=4).max() == 0.0


@pytest.mark.slow
def test_half_a_dome(shot: Any, tmp_path: Path) -> None:
    """Irradiance of a dome image equals the cosine-weighted sum of its pixels."""
    path = write_sky(tmp_path)
    image = sky(latlong_directions(512))
    d = latlong_directions(512)
    weight = np.maximum(d[..., 1], 0.0) * np.sqrt(1.0 - d[..., 1] ** 2)
    expected = 0.5 * (image * weight[..., None]).sum(axis=(0, 1)) / weight.sum()
    found = floor_radiance(shot, light("Dome", texture=path))
    assert np.abs(found / expected - 1.0).max() < 5e-3


# ---- orientation, without a bridge that could rotate both renderers alike ------------------------


@pytest.mark.parametrize("turn", [(0.0, 0.0), (35.0, 0.0), (0.0, 130.0), (20.0, -75.0)])
def test_dome_orientation(shot: Any, tmp_path: Path, turn: tuple[float, float]) -> None:
    """Camera rays that hit the dome return the image in the dome's frame (OpenEXR's latlong)."""
    path = write_sky(tmp_path)
    frame = turned(*turn)
    for towards in ((1, 0.2, 0), (-1, -0.1, 0.1), (0.1, 0.3, 1), (0, 0, -1), (0.3, 1, 0.2)):
        view = camera((0, 0, 0), towards, half=0.001)
        picture = shot(view, light("Dome", texture=path, transform=frame), size=4, spp=1)
        unit = np.array(towards) / np.linalg.norm(towards)
        expected = sky(unit @ np.linalg.inv(frame[:3, :3]))
        assert np.abs(picture.mean(axis=(0, 1)) / expected - 1.0).max() < 5e-3, towards


def test_texture_orientation(shot: Any, tmp_path: Path) -> None:
    """In USD, (0, 0) is the lower left of the image and v points up: 2 x 2 texels on a quad."""
    from wavecomb.scenes.authoring.textures import write_image

    image = np.array([[(1, 0, 0), (0, 1, 0)], [(0, 0, 1), (1, 1, 0)]], np.float32)
    path = tmp_path / "map.exr"
    write_image(path, image, "float")
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    face = quad("Face", corners, "M", uv=[(0, 0), (1, 0), (1, 1), (0, 1)])
    paint = material("M", "diffuse", texture=path)
    picture = shot(camera((0, 0, 5), (0, 0, 0), half=0.2), WHITE, paint, face, size=16, spp=256)
    corner = {(0, 0): (1, 0, 0), (0, 15): (0, 1, 0), (15, 0): (0, 0, 1), (15, 15): (1, 1, 0)}
    for place, colour in corner.items():
        assert np.abs(picture[place] - np.array(colour)).max() < 0.02, place
    middle = picture[7:9, 7:9].mean(axis=(0, 1))
    assert np.abs(middle - np.array((0.5, 0.5, 0.25))).max() < 0.03


def test_row_0_is_the_top_and_x_runs_right(shot: Any) -> None:
    # The emission is above 1, so that the loader treats the surface as a light and adds no default
    # dome.
    lamp = material("L", "emissive", emissiveColor=(2, 2, 2))
    corners = [(0.2, 0.2, 0), (1, 0.2, 0), (1, 1, 0), (0.2, 1, 0)]
    picture = shot(camera((0, 0, 5), (0, 0, 0), half=0.2), lamp, quad("Q", corners, "L"), spp=16)
    half = SIZE // 2
    assert picture[:half, half:].mean() > 0.5
    assert picture[half:].max() == picture[:, :half].max() == 0.0


def test_exposure_intensity_and_colour(shot: Any) -> None:
    """Radiance is colour x intensity x 2^exposure."""
    dome = """def DomeLight "L" {
        color3f inputs:color = (0.5, 0.25, 1)
        float inputs:intensity = 3
        float inputs:exposure = -1
    }"""
    picture = shot(camera((0, 0, 0), (0, 0, -1)), dome, size=2, spp=1)
    assert np.allclose(picture, np.array((0.75, 0.375, 1.5)), rtol=1e-5)


# ---- shadows, mirrors ----------------------------------------------------------------------------


def test_point_light_shadow_edge(shot: Any) -> None:
    """A screen shadows half of the floor; the rest has a point light's inverse square falloff."""
    lamp = light("Sphere", colour=(10, 10, 10), transform=moved(0, 2, 0), radius=0.0)
    screen = quad("Screen", [(0, 1, 3), (3, 1, 3), (3, 1, -3), (0, 1, -3)], "M")
    view = camera((0, 0.9, 0), (0, 0, 0), half=0.2)
    picture = shot(view, FLOOR, ground("M"), screen, lamp, max_depth=1)
    lit, dark = picture[:, : SIZE // 2 - 1], picture[:, SIZE // 2 + 1 :]
    assert dark.max() == 0.0
    assert lit.min() > 0.0


def test_mirror_shows_the_dome(shot: Any, tmp_path: Path) -> None:
    """A mirror in the plane z = 0, seen at an angle, shows the sky in the reflected direction."""
    path = write_sky(tmp_path)
    silver = material("M", "metal", diffuseColor=(1, 1, 1), roughness=0.0)
    face = quad("Q", [(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)], "M")
    eye = np.array((1.0, 0.7, 2.0))
    view = camera(tuple(eye), (0, 0, 0), half=0.001)
    picture = shot(view, light("Dome", texture=path), silver, face, size=4, spp=4)
    gone = np.array((-eye[0], -eye[1], eye[2]))
    expected = sky(gone / np.linalg.norm(gone))
    assert np.abs(picture.mean(axis=(0, 1)) / expected - 1.0).max() < 5e-3


@pytest.mark.slow
def test_fresnel_of_a_pane(shot: Any) -> None:
    """Light straight through a pane: transmittance of two interfaces with all interreflections."""
    glass = material("M", "dielectric", diffuseColor=(1, 1, 1), roughness=0.0, ior=1.5)
    pane = box("Pane", (-9, -9, -0.1), (9, 9, 0.1), "M")
    lamp = light("Rect", transform=look_at((0, 0, -3), (0, 0, 0)), width=1, height=1)
    view = camera((0, 0, 3), (0, 0, 0), half=0.01)
    picture = shot(view, lamp, glass, pane, max_depth=60, spp=2048)
    r = 0.04
    assert picture.mean() == pytest.approx((1 - r) / (1 + r), rel=5e-3)


# ---- AOVs ----------------------------------------------------------------------------------------


def test_layers_of_a_plane(tmp_path: Path) -> None:
    """Depth along the axis, world normals, albedo and sample counts of a tilted plane."""
    body = material("M", "diffuse", diffuseColor=(0.2, 0.4, 0.6))
    corners = [(-9, -9, -4.5), (9, -9, -4.5), (9, 9, 4.5), (-9, 9, 4.5)]  # z = y / 2
    view = camera((0, 0, 8), (0, 0, 0), half=0.25)
    stage = write_stage(tmp_path / "s.usda", view, WHITE, body, quad("Q", corners, "M"))
    picture = wavecomb.render(stage, size=(16, 16), spp=64, filter="box", filter_width=1.0)
    assert (picture.samples == 64).all()
    assert np.abs(picture.albedo - np.array((0.2, 0.4, 0.6))).max() < 1e-5
    normal = np.array((0, -0.5, 1)) / np.hypot(0.5, 1.0)
    assert np.abs(picture.normal - normal).max() < 1e-5
    # On the ray of slope y: z = 8 - t and y = s t = 2 z, so t = 16 / (s + 2).
    slope = 0.25 - 0.5 * (np.arange(16) + 0.5) / 16
    assert np.abs(picture.depth / (16.0 / (slope + 2.0))[:, None] - 1.0).max() < 2e-3


def test_layers_of_nothing(tmp_path: Path) -> None:
    stage = write_stage(tmp_path / "s.usda", camera((0, 0, 8), (0, 0, 0)), WHITE)
    picture = wavecomb.render(stage, size=(8, 8), spp=4)
    assert np.isinf(picture.depth).all()
    assert not picture.normal.any()
    assert np.allclose(picture.beauty, 1.0)


def test_depth_counts_samples_that_hit(tmp_path: Path) -> None:
    """At an edge, depth averages only samples that hit; normals and albedo fade out."""
    body = material("M", "diffuse", diffuseColor=(1, 1, 1))
    corners = [(-5, -5, 0), (0.0, -5, 0), (0.0, 5, 0), (-5, 5, 0)]
    view = camera((0, 0, 8), (0, 0, 0), half=0.25)
    stage = write_stage(tmp_path / "s.usda", view, WHITE, body, quad("Q", corners, "M"))
    picture = wavecomb.render(stage, size=(15, 15), spp=256, filter="box", filter_width=1.0)
    assert np.allclose(picture.depth[:, :8], 8.0, rtol=1e-5)
    assert np.isinf(picture.depth[:, 8:]).all()
    assert np.abs(picture.albedo[:, 7] - 0.5).max() < 0.05


def test_dome_light_turns_with_the_up_axis(tmp_path: Path, beauty: Any) -> None:
    """On a Z-up stage the pole of a DomeLight stays +Y, as UsdLux requires."""
    path = write_sky(tmp_path)
    stage = tmp_path / "z.usda"
    write_stage(stage, camera((0, 0, 0), (0, 1, 0.1), half=0.001), light("Dome", texture=path))
    stage.write_text(stage.read_text().replace('upAxis = "Y"', 'upAxis = "Z"'))
    unit = np.array((0, 1, 0.1)) / np.hypot(1, 0.1)
    found = beauty(wavecomb.load(stage), 4, 1).mean(axis=(0, 1))
    assert np.abs(found / sky(unit) - 1.0).max() < 5e-3
