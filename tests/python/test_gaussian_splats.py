# SPDX-License-Identifier: Apache-2.0
"""Tests Gaussian splats: reading, closed forms, and equal images for all schedules."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from usd_recorder import Recorder, said

import wavecomb
from wavecomb import _core
from wavecomb.cli import main
from wavecomb.image.files.image import linear_from_srgb
from wavecomb.scenes import write_scene
from wavecomb.scenes.splats import basis, linear_harmonics
from wavecomb.usd import load_stage

Floats = NDArray[np.float64]
Y0 = 0.5 / math.sqrt(math.pi)
GREY = "float3[] radiance:sphericalHarmonicsCoefficients = [(0,0,0), (0,0,0)]"
TWO = "point3f[] positions = [(0,0,0), (1,0,0)]"
DEGREE = "uniform int radiance:sphericalHarmonicsDegree = 0"


def tuples(values: Any) -> str:
    rows = np.asarray(values, float)
    if rows.ndim == 1:
        return "[" + ", ".join(repr(float(x)) for x in rows) + "]"
    return "[" + ", ".join("(" + ", ".join(repr(float(x)) for x in row) + ")" for row in rows) + "]"


def particles(name: str = "S", **values: Any) -> str:
    """Returns a splat prim with the given attributes. Quaternions have w first, harmonics are
    (n, k, 3).
    """
    harmonics = np.asarray(values["harmonics"], float)
    n = len(values["positions"])
    lines = [
        f"point3f[] positions = {tuples(values['positions'])}",
        f"float3[] scales = {tuples(values.get('scales', np.ones((n, 3))))}",
        f"quatf[] orientations = {tuples(values.get('orientations', [(1, 0, 0, 0)] * n))}",
        f"float[] opacities = {tuples(values.get('opacities', np.ones(n)))}",
        f"uniform int radiance:sphericalHarmonicsDegree = {math.isqrt(harmonics.shape[1]) - 1}",
        f"float3[] radiance:sphericalHarmonicsCoefficients = {tuples(harmonics.reshape(-1, 3))}",
        values.get("more", ""),
    ]
    return f'def ParticleField3DGaussianSplat "{name}" {{\n' + "\n".join(lines) + "\n}\n"


def stage(folder: Path, *prims: str) -> Path:
    path = folder / "splats.usda"
    path.write_text("#usda 1.0\n" + "\n".join(prims))
    return path


def camera(distance: float = 5.0, aperture: float = 0.01) -> str:
    """Returns a camera that looks along -z and sees about aperture / 50 times the distance."""
    return f"""def Camera "Camera" {{
        float focalLength = 50
        float horizontalAperture = {aperture}
        float verticalAperture = {aperture}
        double3 xformOp:translate = (0, 0, {distance})
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}"""


def recorded(path: Path) -> tuple[Any, str]:
    """Returns the recorded scene of a stage, and its messages about splats."""
    loaded = load_stage(path, builder_factory=Recorder)  # type: ignore[arg-type]
    return loaded.scene, "\n".join(line for line in said(loaded).splitlines() if "splat" in line)


def read(folder: Path, *lines: str) -> tuple[Any, str]:
    """Returns the recorded splats (or None) of a prim given as USD text, and the messages."""
    body = "\n".join(lines)
    path = stage(folder, f'def ParticleField3DGaussianSplat "S" {{\n{body}\n}}')
    scene, told = recorded(path)
    return (scene.mesh("S") if scene.meshes else None), told


# Reading


def test_attributes_are_taken_as_usdvol_has_them(tmp_path: Path) -> None:
    mesh, told = read(
        tmp_path, TWO, "float3[] scales = [(1,2,3), (4,5,6)]",
        "quatf[] orientations = [(1,0,0,0), (0.5,0.5,-0.5,0.5)]", "float[] opacities = [0.25, 1]",
        "uniform int radiance:sphericalHarmonicsDegree = 1",
        "float3[] radiance:sphericalHarmonicsCoefficients = "
        + tuples(np.arange(24).reshape(8, 3)),
    )  # fmt: skip
    assert told == ""
    assert mesh["positions"].tolist() == [[0, 0, 0], [1, 0, 0]]
    assert mesh["scales"].tolist() == [[1, 2, 3], [4, 5, 6]]
    assert mesh["orientations"].tolist() == [[1, 0, 0, 0], [0.5, 0.5, -0.5, 0.5]]
    assert mesh["opacities"].tolist() == [0.25, 1]
    assert mesh["harmonics"].tolist() == np.arange(24.0).reshape(2, 4, 3).tolist()


def test_halves_do_where_there_are_no_floats(tmp_path: Path) -> None:
    mesh, told = read(
        tmp_path, "point3h[] positionsh = [(0,0,0), (1,0,0)]", "half[] opacitiesh = [0.5, 0.25]",
        "half3[] scalesh = [(1,2,3), (4,5,6)]", "float[] opacities = [0.125, 1]",
        "quath[] orientationsh = [(0,1,0,0), (1,0,0,0)]", DEGREE,
        "half3[] radiance:sphericalHarmonicsCoefficientsh = [(1,2,3), (4,5,6)]",
    )  # fmt: skip
    assert told == ""
    assert mesh["opacities"].tolist() == [0.125, 1] and mesh["scales"][1].tolist() == [4, 5, 6]
    assert mesh["orientations"][0].tolist() == [0, 1, 0, 0]
    assert mesh["harmonics"].tolist() == [[[1, 2, 3]], [[4, 5, 6]]]


@pytest.mark.parametrize(
    ("lines", "kept", "says"),
    [
        ([DEGREE, GREY], 2, ""),
        ([], 2, "splats without colours: drawn grey"),
        ([DEGREE, GREY, "float3[] scales = [(1,1,1)]"], 2, "fewer scales than splats: ignored"),
        ([DEGREE, GREY, "float[] opacities = [1,1,1]"], 2, "more opacities than splats"),
        ([DEGREE, GREY, "float3[] scales = [(1,1,1), (1,0,1)]"], 1, "scales that are not from"),
        ([DEGREE, GREY, "float3[] scales = [(1,1,nan), (1,1,1)]"], 1, "scales that are not from"),
        ([DEGREE, GREY, "float[] opacities = [-0.5, 1]"], 1, "opacities that are negative"),
        ([DEGREE, GREY, "float[] opacities = [1.5, 1]"], 2, "opacities above 1: set to 1"),
        ([DEGREE, GREY, "quatf[] orientations = [(0,0,0,0), (2,0,0,0)]"], 1, "orientations of"),
        ([DEGREE, GREY.replace("(0,0,0)]", "(0,inf,0)]")], 1, "colours that are not finite"),
        ([DEGREE, GREY.replace("[(0,0,0),", "[(1,1,1), (0,0,0),")], 2, "more harmonics of splats"),
        (
            ["uniform int radiance:sphericalHarmonicsDegree = 1", GREY],
            2,
            "fewer harmonics of splats",
        ),
        (
            ["uniform int radiance:sphericalHarmonicsDegree = -1", GREY],
            2,
            "fewer harmonics of splats",
        ),
    ],
)
def test_what_does_not_fit_is_told(tmp_path: Path, lines: list[str], kept: int, says: str) -> None:
    mesh, told = read(tmp_path, TWO, *lines)
    assert len(mesh["positions"]) == kept
    assert says in told and (told == "" if not says else "/S" in told)


def test_a_middle_that_is_nowhere_and_none_at_all(tmp_path: Path) -> None:
    mesh, told = read(tmp_path, TWO.replace("(1,0,0)", "(nan,0,0)"), DEGREE, GREY)
    assert len(mesh["positions"]) == 1 and "middles that are not finite" in told
    mesh, told = read(tmp_path, DEGREE, GREY)
    assert mesh is None and "splats without points" in told


def test_degrees_above_three_are_cut(tmp_path: Path) -> None:
    path = stage(tmp_path, particles(positions=[(0, 0, 0)], harmonics=np.ones((1, 25, 3))))
    scene, told = recorded(path)
    assert scene.mesh("S")["harmonics"].shape == (1, 16, 3) and "above degree 3" in told


def test_info_counts_them(tmp_path: Path) -> None:
    path = stage(tmp_path, particles(positions=np.eye(3), harmonics=np.zeros((3, 4, 3))))
    run = CliRunner().invoke(main, ["info", str(path), "--json"])
    info = json.loads(run.output)
    assert info["splats"] == 3 and info["prims"]["splats"] == 1 and info["points"] == 0
    assert not info["unsupported"]


def write_ply(path: Path, columns: dict[str, Any]) -> Path:
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns['x'])}"]
    header += [f"property float {name}" for name in columns] + ["end_header", ""]
    rows = np.stack([np.asarray(values, "<f4") for values in columns.values()], axis=1)
    path.write_bytes("\n".join(header).encode() + rows.tobytes())
    return path


def test_a_capture_becomes_a_stage(tmp_path: Path) -> None:
    """Logarithmic scales, logits and channel order of a capture are converted to UsdVol's."""
    rng = np.random.default_rng(1)
    names = [*"xyz", "opacity", *(f"scale_{k}" for k in range(3)), *(f"rot_{k}" for k in range(4))]
    names += [f"f_dc_{k}" for k in range(3)] + [f"f_rest_{k}" for k in range(9)]
    columns = {name: rng.normal(size=5) for name in names}
    file = write_ply(tmp_path / "c.ply", columns)
    run = CliRunner().invoke(
        main,
        [
            "scene",
            "splats",
            "-o",
            str(tmp_path / "c.usdc"),
            "--capture",
            str(file),
            "--capture-linear",
        ],
    )
    assert run.exit_code == 0, run.output
    scene, told = recorded(tmp_path / "c.usdc")
    mesh = scene.mesh("Capture")
    assert told == ""
    assert mesh["scales"][:, 1] == pytest.approx(np.exp(columns["scale_1"]), rel=1e-5)
    assert mesh["orientations"][:, 0] == pytest.approx(columns["rot_0"], rel=1e-5)
    assert mesh["opacities"] == pytest.approx(1 / (1 + np.exp(-columns["opacity"])), rel=1e-5)
    for k, channel in ((1, 0), (2, 1), (3, 2)):
        wanted = columns[f"f_rest_{3 * channel + k - 1}"]
        assert mesh["harmonics"][:, k, channel] == pytest.approx(wanted, rel=1e-5)
    bad = write_ply(tmp_path / "bad.ply", {name: columns[name] for name in "xyz"})
    with pytest.raises(ValueError, match=r"bad\.ply: not a capture of Gaussian splats: no opacity"):
        write_scene("splats", tmp_path / "d.usdc", capture=bad)


def test_colours_of_captures_are_decoded() -> None:
    """Colours are converted from sRGB in every direction; constant colours convert exactly."""
    rng = np.random.default_rng(2)
    views = rng.normal(size=(64, 3))
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    grey = np.zeros((2, 1, 3))
    grey[1] = (0.3 - 0.5) / 0.28209479
    got = 0.5 + basis(views)[:, :1] @ linear_harmonics(grey)
    assert got[0] == pytest.approx(linear_from_srgb(np.full((64, 3), 0.5)), rel=1e-4)
    assert got[1] == pytest.approx(linear_from_srgb(np.full((64, 3), 0.3)), rel=1e-4)
    several = rng.normal(size=(40, 16, 3)) * 0.05
    several[:, 0] = rng.uniform(-0.8, 1.2, (40, 3))
    encoded = 0.5 + basis(views) @ several
    got = 0.5 + basis(views) @ linear_harmonics(several)
    off = np.abs(got - linear_from_srgb(np.maximum(encoded, 0)))
    assert off.max() < 0.03 and off.mean() < 0.003


# Closed forms


def sidak(tests: int, level: float = 1e-4) -> float:
    """Returns the limit that the largest |z| of ``tests`` exceeds with probability ``level``."""
    from scipy.stats import norm

    return float(norm.isf(0.5 * (1.0 - (1.0 - level) ** (1.0 / tests))))


def test_a_stack_is_composited_front_to_back(tmp_path: Path) -> None:
    """The mean is sum c_i alpha_i prod (1 - alpha_j) in depth order, in front of a black sky."""
    rng = np.random.default_rng(8)
    n = 6
    places = np.stack([rng.uniform(-0.6, 0.6, n), rng.uniform(-0.6, 0.6, n), -np.arange(n)], axis=1)
    turns = rng.normal(size=(n, 4))
    scales = rng.uniform(0.3, 1.2, (n, 3))
    opacities = rng.uniform(0.3, 0.9, n)
    shown = rng.uniform(0.1, 1.0, (n, 3))
    order = rng.permutation(n)
    path = stage(
        tmp_path, camera(),
        particles(
            positions=places[order], scales=scales[order], orientations=turns[order],
            opacities=opacities[order], harmonics=((shown - 0.5) / Y0)[order, None],
        ),
    )  # fmt: skip
    found = []
    for place, turn, scale in zip(places, turns, scales, strict=True):
        w, x, y, z = turn / np.linalg.norm(turn)
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        whiten = (rotation / scale).T
        o, d = whiten @ (np.array([0.0, 0.0, 5.0]) - place), whiten @ np.array([0.0, 0.0, -1.0])
        t = -(o @ d) / (d @ d)
        found.append((t, float(((o + t * d) ** 2).sum())))
    through, mean, square = 1.0, np.zeros(3), np.zeros(3)
    for k in sorted(range(n), key=lambda k: found[k][0]):
        alpha = opacities[k] * math.exp(-0.5 * found[k][1]) * (found[k][1] <= 9.0)
        alpha *= alpha >= 1 / 255
        mean += through * alpha * shown[k]
        square += through * alpha * shown[k] ** 2
        through *= 1.0 - alpha
    assert 0.02 < through < 0.9
    picture = wavecomb.render(path, size=(16, 16), spp=256, seed=4, filter="box", filter_width=1.0)
    rendered = np.asarray(picture.beauty, np.float64).mean((0, 1))
    error = np.sqrt((square - mean**2) / (16 * 16 * 256))
    assert (np.abs(rendered - mean) / error < sidak(3)).all(), (rendered, mean, error)


def test_colours_are_those_of_scipys_harmonics(tmp_path: Path) -> None:
    """The colours of one wide splat, seen from many sides, equal SciPy's harmonics."""
    special = pytest.importorskip("scipy.special")
    rng = np.random.default_rng(5)
    harmonics = rng.normal(size=(1, 16, 3)) * 0.08
    turn = np.array([[0.0, 2, 0, 0], [0, 0, -2, 0], [2, 0, 0, 0], [0, 0, 0, 1]])
    for _ in range(6):
        builder = wavecomb.SceneBuilder()
        shine = builder.add_material("emissive", emission=(1.0, 1.0, 1.0))
        splat = builder.add_splats(
            np.zeros((1, 3), np.float32), np.full((1, 3), 1e3, np.float32),
            np.float32([[1, 0, 0, 0]]), np.ones(1, np.float32), harmonics.astype(np.float32),
            material=shine, name="/S",
        )  # fmt: skip
        group = builder.add_group("turned")
        builder.add_to_group(group, splat)
        builder.add_instances(0, group, turn[None])
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        pose = np.eye(4)
        side = np.cross((0.3, 0.5, 0.7), -d)
        pose[0, :3] = side / np.linalg.norm(side)
        pose[1, :3] = np.cross(-d, pose[0, :3])
        pose[2, :3], pose[3, :3] = -d, -10.0 * d
        builder.set_camera(pose, window=(-1e-6, 1e-6, -1e-6, 1e-6))
        picture = wavecomb.render(builder.build(), size=(2, 2), spp=1)
        x, y, z = d @ np.linalg.inv(turn[:3, :3]) * 2.0
        polar, around = math.acos(z), math.atan2(y, x)
        colour = np.full(3, 0.5)
        kinds = [(degree, m) for degree in range(4) for m in range(-degree, degree + 1)]
        for k, (degree, m) in enumerate(kinds):
            value = special.sph_harm_y(degree, abs(m), polar, around)
            real = value.real if m == 0 else math.sqrt(2.0) * (value.imag if m < 0 else value.real)
            colour += real * harmonics[0, k]
        assert picture.beauty[0, 0] == pytest.approx(np.maximum(colour, 0.0), abs=2e-6)


def test_they_cast_shadows(tmp_path: Path) -> None:
    """A splat in front of the sun transmits 1 - alpha of the light."""
    opacity, off = 0.8, 0.7
    alpha = opacity * math.exp(-0.5 * off**2)
    floor = """def Mesh "Floor" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-50,-50,0), (50,-50,0), (50,50,0), (-50,50,0)]
        color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
    }
    def DistantLight "Sun" { float inputs:intensity = 100
        float inputs:angle = 0
    }
    """.replace("{ float", "{\nfloat")
    above = particles(
        positions=[(off, 0, 20)], scales=[(1, 1, 1)], opacities=[opacity],
        harmonics=np.zeros((1, 1, 3)),
    )  # fmt: skip
    settings: dict[str, Any] = {"size": (16, 16), "max_depth": 1, "seed": 2}
    bare = wavecomb.render(stage(tmp_path, camera(), floor), spp=1, **settings).beauty.mean()
    lit = wavecomb.render(stage(tmp_path, camera(), floor, above), spp=64, **settings).beauty
    error = math.sqrt(alpha * (1 - alpha) / (16 * 16 * 64))
    assert abs(float(lit.mean()) / float(bare) - (1 - alpha)) < sidak(1) * error


# One picture


def scenery(folder: Path) -> Path:
    """Returns rotated, scaled, moving and instanced splats over a floor and in a mirror."""
    path = folder / "scenery.usda"
    write_scene("splats", path, splats=1500, triangles=12_000)
    text = path.read_text()
    moving = """def Xform "Moving" {
        matrix4d xformOp:transform.timeSamples = {
            0: ((1.5,0,0,0), (0,0.6,0.2,0), (0,0,1,0), (-1.5,0.5,0.5,1)),
            1: ((-1.5,0,0,0), (0,0.8,0.2,0), (0.3,0,1,0), (-1.2,0.6,0.5,1)),
        }
        uniform token[] xformOpOrder = ["xformOp:transform"]
        """ + particles(
        positions=[(0, 0, 0), (0.3, 0.2, 0)], scales=np.full((2, 3), 0.3),
        harmonics=np.linspace(-1, 1, 54).reshape(2, 9, 3),
    ) + "}"  # fmt: skip
    path.write_text(text + moving)
    return path


@pytest.mark.slow
def test_one_picture_for_all_schedules(tmp_path: Path) -> None:
    path = scenery(tmp_path)
    for shutter in ((0.0, 0.0), (0.0, 1.0)):
        loaded = wavecomb.load(path, frame=0.0, shutter=shutter)
        settings: dict[str, Any] = {"size": (36, 24), "spp": 3, "max_depth": 5, "roulette": "off"}
        expected = wavecomb.render(loaded, integrator="reference", threads=1, **settings).beauty
        assert expected.max() > 0
        ways = itertools.product(_core.lane_widths(), ("none", "random-runs"), (64, 4096))
        for lanes, policy, wave in ways:
            picture = wavecomb.render(
                loaded, lanes=lanes, policy=policy, wave_size=wave, threads=2, **settings
            )
            assert np.array_equal(picture.beauty, expected), (lanes, policy, wave)


def test_layers_know_them(tmp_path: Path) -> None:
    """Splats have a depth and a normal towards the camera; their light is in the emission layer."""
    path = stage(
        tmp_path, camera(aperture=2.0),
        particles(positions=[(0, 0, 0)], harmonics=np.ones((1, 1, 3)), opacities=[0.9]),
    )  # fmt: skip
    picture = wavecomb.render(path, size=(8, 8), spp=16, aovs=["emission", "normal", "depth"])
    assert np.array_equal(picture.aovs["emission"], picture.beauty)
    assert np.nanmin(picture.depth) == pytest.approx(5.0, abs=0.01)
    assert picture.normal[4, 4, 2] > 0.5
