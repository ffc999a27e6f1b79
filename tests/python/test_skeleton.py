# SPDX-License-Identifier: Apache-2.0
"""Tests UsdSkel against skinning and blend shapes in NumPy."""

import numpy as np
import pytest
from parts import ASSETS, needs_asset
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt
from usd_recorder import Recorder, said

from wavecomb.usd import load_stage

SKELETONS = "usd/openusd/testUsdImagingGLUsdSkel"
JOINTS = ["A", "A/B", "A/B/C"]
POINTS = np.array(
    [[-1, -1, 0], [1, -1, 0], [1, 1, 1], [-1, 1, 1], [-1, 1, 3], [1, 1, 3], [0, 0, 4]], float
)
FACES = [[0, 1, 2, 3], [3, 2, 5, 4], [4, 5, 6]]
NORMALS = np.array([[0, 0.6, 0.8]] * 4 + [[1, 0, 0]] * 3)
BIND = [Gf.Matrix4d().SetTranslate((0, 0, z)) for z in (0, 1, 3)]


def rotation(degrees, axis=(1, 0, 0)):
    return Gf.Rotation(Gf.Vec3d(axis), degrees)


def pose(time):
    """Returns (rotation, translation) of joints B and A, in the joint order of the animation."""
    return [(rotation(20 * time, (0, 1, 0)), (0, 0.1 * time, 1)), (rotation(30 * time), (0, 0, 0))]


def make_stage(*, mesh_order=None, indices, weights, each, constant=False, method=None):
    """Returns a stage with a skeleton and a skinned mesh; the mesh has a transform."""
    stage = Usd.Stage.CreateInMemory()
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(4)
    root = UsdSkel.Root.Define(stage, "/Root")
    skeleton = UsdSkel.Skeleton.Define(stage, "/Root/Skel")
    UsdGeom.Xformable(skeleton).AddTranslateOp().Set((0.5, 0, 0))
    skeleton.GetJointsAttr().Set(JOINTS)
    skeleton.GetBindTransformsAttr().Set(BIND)
    rest = [BIND[0], BIND[1] * BIND[0].GetInverse(), BIND[2] * BIND[1].GetInverse()]
    skeleton.GetRestTransformsAttr().Set(rest)
    animation = UsdSkel.Animation.Define(stage, "/Root/Anim")
    animation.GetJointsAttr().Set(["A/B", "A"])
    animation.GetScalesAttr().Set(Vt.Vec3hArray([(1, 1, 1), (1, 1, 1)]))
    for time in (1, 2, 4):
        turns = [Gf.Quatf(turn.GetQuat()) for turn, _ in pose(time)]
        animation.GetRotationsAttr().Set(Vt.QuatfArray(turns), time)
        places = [Gf.Vec3f(*place) for _, place in pose(time)]
        animation.GetTranslationsAttr().Set(Vt.Vec3fArray(places), time)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(
        [animation.GetPath()]
    )
    mesh = UsdGeom.Mesh.Define(stage, "/Root/Mesh")
    UsdGeom.Xformable(mesh).AddTranslateOp().Set((0, 3, 0))
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(POINTS.astype(np.float32)))
    mesh.GetFaceVertexCountsAttr().Set([len(face) for face in FACES])
    mesh.GetFaceVertexIndicesAttr().Set([i for face in FACES for i in face])
    mesh.GetSubdivisionSchemeAttr().Set("none")
    mesh.GetNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(NORMALS.astype(np.float32)))
    mesh.SetNormalsInterpolation("vertex")
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    if mesh_order:
        binding.CreateJointsAttr().Set(mesh_order)
    binding.CreateGeomBindTransformAttr().Set(Gf.Matrix4d().SetTranslate((0, 0, 0.25)))
    binding.CreateJointIndicesPrimvar(constant, each).Set(Vt.IntArray(indices))
    binding.CreateJointWeightsPrimvar(constant, each).Set(Vt.FloatArray(weights))
    if method:
        binding.CreateSkinningMethodAttr().Set(method)
    assert root
    return stage


def skinned(time, indices, weights, rest=POINTS):
    """Returns world positions (n, 3) and normals by linear blending. ``indices``: into JOINTS."""
    (turn_b, at_b), (turn_a, at_a) = pose(time)
    local = [
        Gf.Matrix4d(turn_a, Gf.Vec3d(at_a)),
        Gf.Matrix4d(turn_b, Gf.Vec3d(at_b)),
        Gf.Matrix4d().SetTranslate((0, 0, 2)),
    ]
    world = [np.array(local[0])]
    for matrix in local[1:]:
        world.append(np.array(matrix) @ world[-1])
    bind = np.array(Gf.Matrix4d().SetTranslate((0, 0, 0.25)))
    joints = [bind @ np.linalg.inv(np.array(b)) @ w for b, w in zip(BIND, world, strict=True)]
    homogeneous = np.c_[rest, np.ones(len(rest))]
    points, normals = np.zeros((len(POINTS), 4)), np.zeros((len(POINTS), 3))
    for k in range(indices.shape[1]):
        for i in range(len(POINTS)):
            joint = joints[indices[i, k]]
            points[i] += weights[i, k] * homogeneous[i] @ joint
            normals[i] += weights[i, k] * NORMALS[i] @ np.linalg.inv(joint[:3, :3]).T
    # The transform of the mesh is ignored.
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return points[:, :3] + np.array([0.5, 0, 0]), normals


INDICES = np.array([[0, 1], [0, 1], [1, 0], [1, 2], [2, 1], [2, 1], [2, 0]])
WEIGHTS = np.array([[1, 0], [0.7, 0.3], [0.5, 0.5], [0.9, 0.1], [0.6, 0.4], [1, 0], [0.8, 0.2]])


def read(stage, **options):
    loaded = load_stage(stage, builder_factory=Recorder, **options)
    return loaded.scene.meshes[0], loaded


@pytest.mark.parametrize("time", [1.0, 2.0, 4.0])
def test_linear_blend_skinning(time):
    stage = make_stage(indices=INDICES.ravel().tolist(), weights=WEIGHTS.ravel().tolist(), each=2)
    mesh, _ = read(stage, frame=time)
    points, normals = skinned(time, INDICES, WEIGHTS)
    assert np.allclose(mesh["positions"], points, atol=1e-5)
    assert np.allclose(mesh["normals"], normals, atol=1e-5)


def test_joint_order_of_the_mesh():
    order = ["A/B/C", "A", "A/B"]
    own = np.array([1, 2, 0])[INDICES]
    stage = make_stage(
        mesh_order=order, indices=own.ravel().tolist(), weights=WEIGHTS.ravel().tolist(), each=2
    )
    mesh, _ = read(stage, frame=2)
    points, normals = skinned(2.0, INDICES, WEIGHTS)
    assert np.allclose(mesh["positions"], points, atol=1e-5)
    assert np.allclose(mesh["normals"], normals, atol=1e-5)


def test_constant_influences():
    stage = make_stage(indices=[1, 2], weights=[0.25, 0.75], each=2, constant=True)
    mesh, _ = read(stage, frame=4)
    points, normals = skinned(4.0, np.tile([1, 2], (7, 1)), np.tile([0.25, 0.75], (7, 1)))
    assert np.allclose(mesh["positions"], points, atol=1e-5)
    assert np.allclose(mesh["normals"], normals, atol=1e-5)


def test_normals_of_corners():
    stage = make_stage(indices=INDICES.ravel().tolist(), weights=WEIGHTS.ravel().tolist(), each=2)
    mesh = UsdGeom.Mesh.Get(stage, "/Root/Mesh")
    flat = [i for face in FACES for i in face]
    # One point has different normals at its corners, so they stay face-varying.
    corners = NORMALS[flat]
    corners[2] = (0, 0, 1)
    mesh.GetNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)))
    mesh.SetNormalsInterpolation("faceVarying")
    read_mesh, _ = read(stage, frame=2)
    _, normals = skinned(2.0, INDICES, WEIGHTS)
    assert read_mesh["normals"].shape == (5, 3, 3)
    assert np.allclose(read_mesh["normals"][0, 0], normals[0], atol=1e-5)
    assert np.allclose(read_mesh["normals"][4], normals[[4, 5, 6]], atol=1e-5)


def test_dual_quaternions_keep_lengths():
    """Halfway to a rotated joint, linear blending shortens an edge, but dual quaternions do not."""
    options = {"indices": [0, 1], "weights": [0.5, 0.5], "each": 2, "constant": True}
    linear, _ = read(make_stage(**options), frame=4)
    dual, _ = read(make_stage(method="dualQuaternion", **options), frame=4)
    edge = np.linalg.norm(POINTS[1] - POINTS[0])
    length = [np.linalg.norm(m["positions"][1] - m["positions"][0]) for m in (linear, dual)]
    assert length[0] < 0.99 * edge and abs(length[1] - edge) < 1e-4


def test_skinning_over_the_shutter():
    stage = make_stage(indices=INDICES.ravel().tolist(), weights=WEIGHTS.ravel().tolist(), each=2)
    mesh, _ = read(stage, frame=1, shutter=(0.0, 1.0))
    steps = len(mesh["positions"])
    assert 3 <= steps <= 8 and mesh["normals"].shape == (steps, 7, 3)
    for step, time in ((0, 1.0), (-1, 2.0)):
        points, normals = skinned(time, INDICES, WEIGHTS)
        assert np.allclose(mesh["positions"][step], points, atol=1e-5)
        assert np.allclose(mesh["normals"][step], normals, atol=1e-5)


def test_blend_shapes_with_inbetweens():
    stage = make_stage(indices=[0], weights=[1.0], each=1, constant=True)
    rng = np.random.default_rng(3)
    full, half, other = (rng.normal(size=(len(POINTS), 3)) for _ in range(3))
    smile = UsdSkel.BlendShape.Define(stage, "/Root/Mesh/Smile")
    smile.GetOffsetsAttr().Set(Vt.Vec3fArray.FromNumpy(full.astype(np.float32)))
    between = smile.CreateInbetween("half")
    between.SetWeight(0.5)
    between.SetOffsets(Vt.Vec3fArray.FromNumpy(half.astype(np.float32)))
    frown = UsdSkel.BlendShape.Define(stage, "/Root/Mesh/Frown")
    frown.GetOffsetsAttr().Set(Vt.Vec3fArray.FromNumpy(other[:2].astype(np.float32)))
    frown.GetPointIndicesAttr().Set([4, 6])
    binding = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Root/Mesh"))
    binding.CreateBlendShapesAttr().Set(["smile", "frown"])
    binding.CreateBlendShapeTargetsRel().SetTargets([smile.GetPath(), frown.GetPath()])
    animation = UsdSkel.Animation.Get(stage, "/Root/Anim")
    animation.GetBlendShapesAttr().Set(["frown", "smile"])
    weights = {1.0: (0.25, 0.2), 2.0: (1.0, 0.5), 4.0: (-0.5, 0.8)}
    for time, values in weights.items():
        animation.GetBlendShapeWeightsAttr().Set(Vt.FloatArray(values), time)
    rest = read(stage, frame=1)[0]["positions"]
    for time, (frowns, smiles) in weights.items():
        # Piecewise linear through 0, the inbetween at 0.5, and the shape at 1.
        if smiles <= 0.5:
            offset = half * smiles / 0.5
        else:
            offset = half + (full - half) * (smiles - 0.5) / 0.5
        offset[[4, 6]] += frowns * other[:2]
        mesh, _ = read(stage, frame=time)
        expected, _ = skinned(time, np.zeros((7, 1), int), np.ones((7, 1)), POINTS + offset)
        assert np.allclose(mesh["positions"], expected, atol=1e-5)
    assert not np.allclose(read(stage, frame=2)[0]["positions"], rest)


def test_skins_that_do_not_fit_rest():
    stage = make_stage(indices=[0, 1], weights=[1.0, 1.0], each=1)
    mesh, loaded = read(stage, frame=2)
    assert np.allclose(mesh["positions"], POINTS + np.array([0, 3, 0]), atol=1e-5)
    assert "rest pose" in said(loaded)


def test_instances_with_animations_of_their_own():
    stage = make_stage(indices=[0], weights=[1.0], each=1, constant=True)
    other = UsdSkel.Animation.Define(stage, "/Still")
    other.GetJointsAttr().Set(["A"])
    other.GetScalesAttr().Set(Vt.Vec3hArray([(1, 1, 1)]))
    other.GetRotationsAttr().Set(Vt.QuatfArray([Gf.Quatf(1)]))
    other.GetTranslationsAttr().Set(Vt.Vec3fArray([(0, 0, 9)]))
    stage.GetPrimAtPath("/Root/Skel").RemoveProperty("skel:animationSource")
    for name, animation in (("One", "/Root/Anim"), ("Two", "/Still")):
        prim = stage.DefinePrim(f"/{name}", "SkelRoot")
        prim.GetReferences().AddInternalReference("/Root")
        prim.SetInstanceable(True)
        binding = UsdSkel.BindingAPI.Apply(prim)
        binding.CreateAnimationSourceRel().SetTargets([animation])
    stage.GetPrimAtPath("/Root").SetSpecifier(Sdf.SpecifierClass)
    scene = load_stage(stage, builder_factory=Recorder, frame=2).scene
    heights = sorted(m["positions"][:, 2].mean() for m in scene.meshes)
    assert len(heights) == 2 and heights[1] - heights[0] > 5


@pytest.mark.slow
@needs_asset(f"{SKELETONS}/arm.usda", f"{SKELETONS}/arm_baked.usda")
def test_the_arm_of_openusd_is_as_it_baked_it():
    folder = ASSETS / SKELETONS
    for frame in (1, 5, 10):
        mine, baked = (
            load_stage(folder / name, frame=frame, builder_factory=Recorder).scene.meshes[0]
            for name in ("arm.usda", "arm_baked.usda")
        )
        assert np.allclose(mine["positions"], baked["positions"], atol=1e-4)
