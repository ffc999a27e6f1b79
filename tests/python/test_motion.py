# SPDX-License-Identifier: Apache-2.0
"""Tests motion blur: values read from stages, and rendered images."""

import numpy as np
import pytest
from click.testing import CliRunner
from usd_recorder import QUAD, Recorder, load, said, write

import wavecomb
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import read_layers
from wavecomb.usd import load_stage

HEADER = """#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 10
    timeCodesPerSecond = 24
)
"""


def camera(opens=0.0, closes=0.5, body=""):
    return f"""
def Camera "Cam" {{
    double shutter:open = {opens}
    double shutter:close = {closes}
    {body}
}}
"""


MOVING = """
def Xform "Mover" {
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 3: (4, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "Quad" { %s }
}
"""


def mesh(body):
    return 'def Mesh "Quad" { ' + body + " }"


def stage(text):
    return HEADER + text


def test_moving_transforms_become_moving_instances(tmp_path):
    scene, loaded = load(tmp_path, stage(camera(0, 0.5) + MOVING % QUAD), frame=1)
    ((name, motion),) = scene.motions
    assert name == "/Mover/Quad" and motion.shape == (1, 2, 4, 4)
    assert motion[0, :, 3, 0].tolist() == [0.0, 1.0]
    assert loaded.shutter == (0.0, 0.5)
    # The points are those of the stage: not transformed, and not copied.
    assert scene.mesh("Quad")["positions"].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    "options",
    [{"motion_blur": False}, {"shutter": (0.0, 0.0)}, {"frame": 5.0}],
    ids=["off", "closed", "at rest"],
)
def test_what_does_not_move_stays_as_it_was(tmp_path, options):
    scene, _ = load(tmp_path, stage(camera() + MOVING % QUAD), **{"frame": 1.0, **options})
    assert scene.motions == [] and "motion" not in scene.camera
    ((found, matrix, _),) = scene.world_meshes()
    assert found["positions"].ndim == 2
    x = (found["positions"] @ matrix[:3, :3] + matrix[3, :3])[0, 0]
    assert x == (4.0 if options.get("frame") == 5.0 else 0.0)


def test_the_shutter_of_the_options_goes_before_the_cameras(tmp_path):
    scene, loaded = load(
        tmp_path, stage(camera(0, 0.5) + MOVING % QUAD), frame=2, shutter=(-0.5, 0.25)
    )
    ((_, motion),) = scene.motions
    assert motion[0, :, 3, 0].tolist() == [1.0, 2.5] and loaded.shutter == (-0.5, 0.25)


def test_no_shutter_no_time_codes(tmp_path):
    scene, _ = load(tmp_path, stage('def Camera "Cam" {}' + MOVING % QUAD), frame=1)
    assert scene.motions == []
    scene, loaded = load(tmp_path, camera() + MOVING % QUAD, shutter=(0.0, 1.0))
    assert scene.motions == [] and "choose a frame" in said(loaded)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"shutter": (0.5, 0.0)}, "when it opens"),
        ({"shutter": (0.0, float("nan"))}, "must be two numbers"),
        ({"motion_steps": 1}, "from 2 to 64"),
    ],
)
def test_bad_options(tmp_path, options, why):
    with pytest.raises(WavecombError, match=why):
        load(tmp_path, stage(MOVING % QUAD), **options)


def test_turning_takes_more_steps_and_passes_through_them(tmp_path):
    turning = """
def Xform "Wheel" {
    double xformOp:rotateZ.timeSamples = { 1: 0, 2: 90 }
    uniform token[] xformOpOrder = ["xformOp:rotateZ"]
    def Mesh "Quad" { %s }
}
"""
    scene, _ = load(tmp_path, stage(camera(0, 0.5) + turning % QUAD), frame=1)
    ((_, motion),) = scene.motions
    count = motion.shape[1]
    assert 3 <= count <= 8
    angle = np.radians(np.linspace(0, 45, count))
    assert np.allclose(motion[0, :, 0, 0], np.cos(angle)) and np.allclose(
        motion[0, :, 0, 1], np.sin(angle)
    )
    scene, _ = load(tmp_path, stage(camera(0, 0.5) + turning % QUAD), frame=1, motion_steps=2)
    assert scene.motions[0][1].shape[1] == 2


def test_samples_within_the_shutter_get_steps(tmp_path):
    bent = (
        QUAD.replace("point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0)]", "")
        + """
    point3f[] points.timeSamples = {
        1: [(0,0,0), (1,0,0), (1,1,0), (0,1,0)],
        1.25: [(0,0,3), (1,0,3), (1,1,3), (0,1,3)],
        1.75: [(0,0,0), (1,0,0), (1,1,0), (0,1,0)]
    }
    normal3f[] normals.timeSamples = { 1: [(0,0,1), (0,0,1), (0,0,1), (0,0,1)],
                                       2: [(1,0,0), (1,0,0), (1,0,0), (1,0,0)] }
"""
    )
    scene, _ = load(tmp_path, stage(camera(0, 1) + mesh(bent)), frame=1)
    quad = scene.mesh("Quad")
    assert quad["positions"].shape == (5, 4, 3)
    assert quad["positions"][:, 0, 2].tolist() == [0.0, 3.0, 1.5, 0.0, 0.0]
    assert np.allclose(quad["normals"][:, 0], np.array([[4, 0, 0], [3, 0, 1], [2, 0, 2], [1, 0, 3],
        [0, 0, 4]])[::-1] / np.linalg.norm([[4, 0, 0], [3, 0, 1], [2, 0, 2], [1, 0, 3],
        [0, 0, 4]], axis=1)[::-1, None], atol=1e-6)  # fmt: skip


def test_velocities_move_points_that_have_one_sample(tmp_path):
    fast = (
        QUAD
        + """
    vector3f[] velocities = [(24,0,0), (24,0,0), (24,0,0), (24,0,0)]
    vector3f[] accelerations = [(0,576,0), (0,576,0), (0,576,0), (0,576,0)]
"""
    )
    text = mesh(fast)
    timed = text.replace("point3f[] points = [", "point3f[] points.timeSamples = { 1: [").replace(
        "(0,1,0)]\n    int[] faceV", "(0,1,0)] }\n    int[] faceV", 1
    ).replace("velocities = [", "velocities.timeSamples = { 1: [").replace(
        "accelerations = [", "accelerations.timeSamples = { 1: ["
    ).replace("(24,0,0)]", "(24,0,0)] }").replace("(0,576,0)]", "(0,576,0)] }")  # fmt: skip
    scene, _ = load(tmp_path, stage(camera(0, 1) + timed), frame=1)
    moved = scene.mesh("Quad")["positions"][:, 0]
    when = np.linspace(0, 1, len(moved))
    assert len(moved) == 3
    assert np.allclose(moved, np.stack([when, 0.5 * when**2, 0 * when], axis=1), atol=1e-5)


def test_points_that_come_and_go_are_not_blurred(tmp_path):
    text = """
def Mesh "Fluid" {
    point3f[] points.timeSamples = {
        1: [(0,0,0), (1,0,0), (1,1,0)], 1.2: [(0,0,0), (1,0,0), (1,1,0), (0,1,0)] }
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0,1,2]
    uniform token subdivisionScheme = "none"
}
"""
    scene, loaded = load(tmp_path, stage(camera() + text), frame=1)
    assert scene.mesh("Fluid")["positions"].shape == (3, 3)
    assert "is not blurred" in said(loaded)


PLACED = """
def Scope "Protos" {
    def Xform "Thing" { def Mesh "Quad" { %s } }
}
def Xform "A" ( instanceable = true
    references = </Protos/Thing> ) {
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (0, 6, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "B" ( instanceable = true
    references = </Protos/Thing> ) { }
def PointInstancer "Many" {
    rel prototypes = </Protos/Thing>
    int[] protoIndices = [0, 0, 0]
    int64[] invisibleIds = [1]
    point3f[] positions.timeSamples = {
        1: [(0,0,0), (1,0,0), (2,0,0)], 2: [(0,0,8), (1,0,8), (2,0,8)] }
}
"""


def test_instances_and_point_instancers_move(tmp_path):
    scene, _ = load(tmp_path, stage(camera() + PLACED % QUAD), frame=1)
    moved = {motion.shape: motion for _, motion in scene.motions}
    assert set(moved) == {(1, 2, 4, 4), (2, 2, 4, 4)}
    assert moved[1, 2, 4, 4][0, :, 3, 1].tolist() == [0.0, 3.0]
    assert moved[2, 2, 4, 4][:, :, 3].tolist() == [
        [[0, 0, 0, 1], [0, 0, 4, 1]],
        [[2, 0, 0, 1], [2, 0, 4, 1]],
    ]


def test_moving_camera_and_lights(tmp_path):
    body = """
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 5), 2: (2, 0, 5) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
"""
    light = """
def SphereLight "Lamp" {
    double3 xformOp:translate.timeSamples = { 1: (0, 4, 0), 2: (4, 4, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    scene, loaded = load(tmp_path, stage(camera(0, 0.5, body) + light + mesh(QUAD)), frame=1)
    assert scene.camera["motion"].shape == (2, 4, 4)
    assert scene.camera["motion"][:, 3, 0].tolist() == [0.0, 1.0]
    assert scene.camera["transform"][3, 0] == 0.0  # at the frame
    assert scene.lights[0]["transform"][3, 0] == 1.0
    assert scene.lights[0]["motion"][:, 3, 0].tolist() == [0.0, 2.0]
    assert "mid-shutter" not in said(loaded)


SCENE = """
def Camera "Cam" {
    double shutter:open = 0
    double shutter:close = 1
    float focalLength = 20
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0.5, 0.5, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "Sky" {}
def Xform "Mover" {
    double3 xformOp:translate.timeSamples = { 1: (-1, 0, 0), 2: (1, 0.5, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "Quad" { %s }
}
def Mesh "Floor" {
    point3f[] points = [(-3,-1,-3), (3,-1,-3), (3,-1,3), (-3,-1,3)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [3,2,1,0]
    uniform token subdivisionScheme = "none"
}
"""


STRANDS = """
def BasisCurves "Hair" {
    uniform token type = "cubic"
    uniform token basis = "bspline"
    int[] curveVertexCounts = [5]
    float[] widths = [0.2]
    point3f[] points.timeSamples = {
        1: [(0,-1,0.5), (0,0,0.5), (0,0.5,0.5), (0,1,0.5), (0,2,0.5)],
        2: [(0,-1,0.5), (0,0,0.5), (0.4,0.5,0.5), (0.9,1,0.5), (1.4,2,0.5)]
    }
}
def BasisCurves "Blade" {
    uniform token type = "linear"
    int[] curveVertexCounts = [2]
    float[] widths = [0.3]
    normal3f[] normals = [(0,0,1), (0,0,1)]
    point3f[] points.timeSamples = {
        1: [(1,0,0.2), (1,1,0.2)], 2: [(1.2,0,0.2), (1.8,0.8,0.4)]
    }
}
def Points "Dust" {
    point3f[] points.timeSamples = { 1: [(0.2,1.4,0), (0.8,1.4,0)] }
    vector3f[] velocities.timeSamples = { 1: [(0,-24,0), (12,0,0)] }
    float[] widths = [0.3, 0.2]
}
def Xform "Carrier" {
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (-0.5, 0.5, 0) }
    double3 xformOp:scale = (1, 0.5, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    def Points "Balls" {
        point3f[] points = [(1.4, 0.4, 0.5)]
        float[] widths = [0.4]
    }
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", STRANDS], ids=["mesh", "curves and points"])
def test_blur_is_the_mean_of_still_frames(tmp_path, more):
    path = write(tmp_path, stage(SCENE % QUAD + more))
    settings = {"size": (24, 24), "threads": 1, "max_depth": 3}
    blurred = wavecomb.render(load_stage(path, frame=1), spp=512, error=True, **settings)
    stills = []
    for k in range(64):
        still = load_stage(path, frame=1 + (k + 0.5) / 64, motion_blur=False)
        assert not still.scene.moves
        stills.append(wavecomb.render(still, spp=8, seed=k, **settings).beauty)
    mean = np.mean(stills, axis=0, dtype=np.float64)
    # Both images have 512 samples, so the squared error of their difference is at most twice that
    # of one image.
    sigma = np.sqrt(2 * np.maximum(np.asarray(blurred.error) ** 2, 1e-6)).reshape(24, 24, -1)
    z = np.abs(mean - blurred.beauty).max(axis=2) / np.maximum(sigma.max(axis=2), 2e-3)
    assert np.quantile(z, 0.95) < 3 and z.max() < 8
    assert abs(mean.mean() - blurred.beauty.mean()) < 2e-3
    assert np.abs(stills[0] - blurred.beauty).max() > 0.2


def test_one_picture_for_all_schedules_from_a_stage(tmp_path):
    loaded = load_stage(write(tmp_path, stage(SCENE % QUAD + STRANDS)), frame=1)
    assert loaded.scene.moves
    pictures = [
        wavecomb.render(loaded, size=(24, 24), spp=4, **options).beauty.tobytes()
        for options in (
            {"integrator": "reference"},
            {"policy": "none", "threads": 1},
            {"policy": "material", "threads": 2, "wave_size": 128},
            {"policy": "cost-benefit", "lanes": 1},
        )
    ]
    assert len(set(pictures)) == 1


def test_names_of_what_moves_are_its_prims(tmp_path):
    loaded = load_stage(write(tmp_path, stage(SCENE % QUAD)), frame=1)
    names = {name for name, _ in loaded.scene.object_names}
    assert {"/Mover/Quad", "/Floor"} <= names


def test_subdivision_surfaces_change_their_shape(tmp_path):
    cage = """
def Mesh "Cage" {
    point3f[] points.timeSamples = {
        1: [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (0,0,1), (1,0,1), (1,1,1), (0,1,1)],
        2: [(0,0,0), (2,0,0), (2,1,0), (0,1,1), (0,0,2), (1,0,3), (1,1,1), (0,1,1)]
    }
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0,3,2,1, 4,5,6,7, 0,1,5,4, 1,2,6,5, 2,3,7,6, 3,0,4,7]
}
"""
    path = write(tmp_path, stage(camera(0, 1) + cage))

    def read(**options):
        loaded = load_stage(path, subdivision=2, builder_factory=Recorder, **options)
        return loaded.scene.mesh("Cage")

    moving = read(frame=1)
    assert moving["positions"].shape[0] == 2 and moving["normals"].shape[0] == 2
    for step, frame in ((0, 1), (1, 2)):
        still = read(frame=frame, motion_blur=False)
        # Quads are split along the better diagonal of the first step.
        assert step != 0 or np.array_equal(moving["indices"], still["indices"])
        assert np.array_equal(moving["positions"][step], still["positions"])
        assert np.array_equal(moving["normals"][step], still["normals"])


def test_options_of_the_command(tmp_path):
    path = write(tmp_path, stage(SCENE % QUAD))

    def run(*options):
        arguments = ["render", path, "-o", tmp_path / "a.exr", "--size", 8, 8, "--spp", 4, *options]
        return CliRunner().invoke(main, [str(argument) for argument in arguments])

    assert run().exit_code == 0
    blurred = read_layers(tmp_path / "a.exr")["beauty"]
    assert run("--shutter", 0, 1, "--motion-steps", 3).exit_code == 0
    assert np.allclose(read_layers(tmp_path / "a.exr")["beauty"], blurred, atol=1e-3)
    assert run("--no-motion-blur").exit_code == 0
    assert np.abs(read_layers(tmp_path / "a.exr")["beauty"] - blurred).max() > 0.05
    bad = run("--shutter", 1, 0)
    assert bad.exit_code == 2 and "when it opens" in bad.stderr
