# SPDX-License-Identifier: Apache-2.0
"""The native core: scenes in, pictures out.

Arrays are NumPy arrays and are not copied where said so.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

INHERIT_MATERIAL: int
"""Material id that means "what the instance says"."""

class Error(ValueError):
    """Bad input; one line that names the object and says what to do."""

class VolumeGrid:
    """Voxels in bricks of 8 x 8 x 8, and where they are.

    Args:
        origins: (n, 3): index of the first voxel of each brick; multiples of 8, each once.
        values: float16 or float32, (n, 8, 8, 8) or (n, 8, 8, 8, 3): ``values[b, i, j, k]`` is
            voxel ``origins[b] + (i, j, k)``. A voxel's value is that at its index; between them it
            is linear in x, y and z.
        index_to_object: (4, 4), from indices to the volume's own space, as USD has it (rows).
        background: Where there is no brick.
        name: For messages.
        is_signed: Values may be below 0: velocities.

    Raises Error for values that are negative or not finite, bricks that are doubled or not at
    multiples of 8, and grids too large to be numbered.
    """

    def __init__(
        self,
        origins: NDArray[np.int32],
        values: NDArray[Any],
        index_to_object: NDArray[Any],
        background: float = 0.0,
        name: str = "",
        is_signed: bool = False,
    ) -> None: ...
    @property
    def bricks(self) -> int:
        """Those that are kept: with a border, and without those that are background."""
    @property
    def bytes(self) -> int: ...

class Scene:
    """An immutable scene."""

    @property
    def triangles(self) -> int:
        """Triangles of all meshes, each counted once."""
    @property
    def instanced_triangles(self) -> int:
        """Triangles as seen, every instance counted."""
    @property
    def curve_segments(self) -> int: ...
    @property
    def points(self) -> int: ...
    @property
    def splats(self) -> int: ...
    @property
    def mesh_count(self) -> int:
        """Meshes, and prims of curves, points and splats."""
    @property
    def instance_count(self) -> int: ...
    @property
    def volumes(self) -> list[str]:
        """Names of the volumes."""
    @property
    def light_count(self) -> int: ...
    @property
    def lights(self) -> list[tuple[str, str]]:
        """(name, kind) of every light but emissive meshes."""
    @property
    def materials(self) -> list[tuple[str, str]]:
        """(name, program) of every material."""
    @property
    def textures(self) -> list[tuple[str, int]]:
        """(name, bytes) of every texture."""
    def fingerprint(self, arrays: bool = True) -> dict[str, str]:
        """Hashes of what decides over the picture, and of names: geometry, materials, textures,
        lights, camera, names.

        arrays: geometry and textures, too, of which every byte is read."""
    @property
    def camera(self) -> dict[str, Any]:
        """As set_camera takes it, but for motion; its transform is to_world (4, 4)."""
    def material(self, material: int) -> dict[str, Any]:
        """name, program and parameters of a material as add_material takes them; its textures with
        their names as well; driven: names of parameters that a graph computes. Raises Error for an
        id that is not there."""
    def light(self, light: int) -> dict[str, Any]:
        """name, kind, transform and parameters of a light as add_light takes them, its group by
        name; texture: the name of its texture, or None. Raises Error for an index that is not
        there."""
    @property
    def light_groups(self) -> list[str]:
        """Names; the first, "other", is of lights without a group."""
    @property
    def object_names(self) -> list[tuple[str, str]]:
        """(object, asset) as Cryptomatte names them: meshes instance by instance, then lights."""
    @property
    def moves(self) -> bool:
        """Whether a mesh, an instance or the camera moves while the shutter is open."""
    @property
    def warnings(self) -> list[str]: ...
    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]: ...
    def bounds_of(
        self, prim: str
    ) -> tuple[tuple[float, float, float], tuple[float, float, float]] | None:
        """World bounds of the meshes that are a prim or are in it; None where there are none."""

class TextureStore:
    """Keeps the textures of scenes within a limit of memory, and the rest in a temporary file."""

    def __init__(self, limit_bytes: int, folder: str) -> None:
        """``folder``: for the file, made when textures do not fit. Raises Error."""
    @staticmethod
    def obstacle() -> str:
        """Why this system can have none; "" where it can."""
    @property
    def limit_bytes(self) -> int: ...
    def set_waiting(self, bytes: int) -> None:
        """Says that images of so many bytes lie ready to become textures: they count."""
    @property
    def statistics(self) -> dict[str, float]:
        """``texture_store`` of docs/statistics.md, as it is now."""

class SceneBuilder:
    """Collects a scene; ids are handed out from 0 in order.

    Transforms are in USD's row-vector convention (translation in the last row),
    float64 or float32, shape (4, 4).
    """

    def __init__(self, threads: int = 0, store: TextureStore | None = None) -> None:
        """``store``: keeps the textures that are added; None: they are in memory."""
    def add_texture(
        self,
        pixels: NDArray[Any],
        *,
        srgb: bool,
        wrap_s: str = "repeat",
        wrap_t: str = "repeat",
        name: str = "",
    ) -> int:
        """Pixels (height, width, 1 to 4 channels): uint8, float16 or float32, top row first.

        wrap: repeat, clamp, mirror, black. srgb matters for uint8 only.
        Tiled and mip-mapped inside.
        """
    def add_tiles(
        self,
        name: str,
        tiles: list[tuple[int, int]],
        missing: tuple[float, ...],
    ) -> int:
        """Texture id of a UDIM texture of textures that were added: (tile number, texture id).

        ``missing``: linear r, g, b, alpha where there is no tile.
        """

    def share_texture(self, scene: Scene, texture: int) -> int:
        """Adds a texture of another scene, by its id there, without a copy. Raises Error."""
    def add_graph(
        self,
        ops: bytes,
        constants: Sequence[float],
        images: Sequence[tuple[int, float]],
        outputs: Sequence[tuple[int, int]],
        attributes: Sequence[str] = (),
    ) -> int:
        """A value graph, for ``add_material``: operations of 16 bytes as GraphOp in
        graph/graph.h has them, images as (texture, stretch), outputs as (component of
        GRAPH_PARAMETERS, operand), names of attributes of meshes. Raises Error for one that reads
        what is not there."""
    def add_material(
        self,
        program: str,
        *,
        name: str = "",
        # ---- material_table(): tools/update_stub ----
        base_color: tuple[float, float, float] = (0.18, 0.18, 0.18),
        specular_color: tuple[float, float, float] = (0, 0, 0),
        emission: tuple[float, float, float] = (0, 0, 0),
        roughness: float = 0.5,
        metallic: float = 0,
        clearcoat: float = 0,
        clearcoat_roughness: float = 0.01,
        opacity: float = 1,
        ior: float = 1.5,
        opacity_threshold: float = 0,
        conductor_eta: tuple[float, float, float] = (0, 0, 0),
        conductor_k: tuple[float, float, float] = (0, 0, 0),
        specular_workflow: bool = False,
        presence: bool = False,
        azimuthal_roughness: float = 0.3,
        scale_tt: float = 0.5,
        scale_trt: float = 2,
        cuticle_tilt: float = 0,
        tint_r: float = 1,
        tint_tt: float = 1,
        tint_trt: float = 1,
        # ---- to here ----
        openpbr: dict[str, Any] = {},
        textures: dict[str, dict[str, Any]] = {},
        graph: int | None = None,
        opacity_graph: int | None = None,
        emission_graph: int | None = None,
    ) -> int:
        """Programs: diffuse, metal, dielectric, plastic, emissive, principled, openpbr.

        textures: slot -> {"texture": id, "channel": "rgb"|"r"|"g"|"b"|"a", "scale": 4 floats,
        "bias": 4 floats, "uv": 6 floats}; value = texel * scale + bias at
        u' = uv[0] u + uv[1] v + uv[2], v' = uv[3] u + uv[4] v + uv[5]. Slots: base_color,
        specular_color, emission, roughness, metallic, clearcoat, clearcoat_roughness, opacity,
        normal (tangent space, value already in [-1, 1] after scale and bias).
        For a metal: base_color is the reflectance at normal incidence, specular_color the tint at
        82 degrees (black: none given, untinted).
        openpbr, for the program of that name: diffuse_roughness, specular_weight, anisotropy,
        rotation (turns), transmission_weight, transmission_color, transmission_depth,
        subsurface_weight, subsurface_color, subsurface_radius (mean free paths; 0: diffuse),
        subsurface_anisotropy, fuzz_weight, fuzz_color, fuzz_roughness, coat_color, coat_ior,
        coat_darkening, film_weight, film_thickness (nanometres), film_ior, thin_walled. Its coat
        takes clearcoat and clearcoat_roughness.
        """
    def add_mesh(
        self,
        positions: NDArray[np.float32],
        indices: NDArray[np.uint32] | NDArray[np.int32],
        *,
        normals: NDArray[np.float32] | None = None,
        uvs: NDArray[np.float32] | None = None,
        face_materials: NDArray[np.uint32] | None = None,
        material: int = ...,
        attributes: Mapping[str, tuple[str, NDArray[np.float32]]] = ...,
        name: str = "",
        light_group: str = "",
        asset_length: int = 0,
        mesh_light: int | None = None,
    ) -> int:
        """Positions (n, 3), or (s, n, 3) at s equal steps over the shutter, and normals likewise;
        triangles (m, 3) counter-clockwise from outside; normals (n, 3) per
        vertex or (m, 3, 3) per corner; uvs (n, 2) or (m, 3, 2); face_materials (m,). attributes:
        name -> (rate, values (k, c) of 1 to 4 components): "constant" (k = 1), "primitive" (m),
        "vertex" (n) or "corner" (3 m); of curves "end" (2 m) in place of the last two.
        No copy of C-ordered arrays of these types: they are kept alive. Do not change them
        afterwards. light_group: of what it emits. asset_length: so much of its name, a prim path,
        names the asset that it is part of; 0: none known. mesh_light: what add_mesh_light gave."""
    def add_meshes(
        self,
        positions: NDArray[np.float32],
        indices: NDArray[np.uint32],
        points: NDArray[np.uint32],
        triangles: NDArray[np.uint32],
        materials: NDArray[np.uint32],
        asset_lengths: NDArray[np.uint32],
        groups: NDArray[np.uint32],
        names: list[str],
    ) -> int:
        """Many meshes that have nothing but points and one material; the first one's id.

        Positions (n, 3) and indices (m, 3) are those of one mesh after another, of so many points
        and triangles each; indices count from the mesh's first point. groups: to put each into;
        0xffffffff: none. Others as in add_mesh."""
    def replace_mesh(
        self,
        mesh: int,
        positions: NDArray[np.float32],
        indices: NDArray[np.uint32] | NDArray[np.int32],
        *,
        normals: NDArray[np.float32] | None = None,
        uvs: NDArray[np.float32] | None = None,
        face_materials: NDArray[np.uint32] | None = None,
        material: int = ...,
        attributes: Mapping[str, tuple[str, NDArray[np.float32]]] = ...,
    ) -> None:
        """Gives a mesh other arrays, as add_mesh takes them; its name and its groups stay."""
    def make_surfaces(
        self, descriptions: list[dict[str, Any]], threads: int = 0
    ) -> list[dict[str, Any] | str]:
        """Subdivision surfaces and displaced polygons as triangle meshes, in parallel.

        Each description: level (0: polygons), points (n, 3) float32, counts (faces,) and indices
        (corners,) int32, left_handed; from level 1 on scheme, boundary, face_varying (tokens of
        UsdGeomMesh), smooth_triangles, and as there are holes, crease_edges (k, 2) int32 with
        crease_sharpness (k,) float32, corner_vertices and corner_sharpness; at level 0 triangles
        (m, 3) and triangle_faces (m,) uint32, and triangle_corners (m * 3,) for face-varying uvs.
        As there are: matrix (4, 4) float64, row vectors; uvs and a list primvars of
        {"interpolation": "vertex", "varying" or "faceVarying", "values": (k, width) float32,
        "width", "indices": (corners,) int32 where it is face-varying}; displacements, a list of
        lengths and of texture uses as add_material takes them, and face_displacement (faces,)
        int32: which of them, -1 for none. At level 0 values of face-varying primvars are those of
        the triangles' corners (3 m, width), without indices.

        Returns for each either a line that says why there is no mesh, or positions, normals, uvs
        (or None), triangles, faces (m,): face of the cage of each triangle, primvars: attributes
        as add_mesh takes them, "vertex" or "corner", and manifold: false where edges or points had
        to be kept sharp.
        """
    def add_curves(
        self,
        kind: str,
        positions: NDArray[np.float32],
        segments: NDArray[np.uint32],
        radii: NDArray[np.float32],
        *,
        normals: NDArray[np.float32] | None = None,
        uvs: NDArray[np.float32] | None = None,
        face_materials: NDArray[np.uint32] | None = None,
        material: int = ...,
        attributes: Mapping[str, tuple[str, NDArray[np.float32]]] = ...,
        name: str = "",
        light_group: str = "",
        asset_length: int = 0,
    ) -> int:
        """Kinds: linear-tube, cubic-tube, linear-ribbon, cubic-ribbon. Positions (n, 3), or
        (steps, n, 3) over the shutter, of Bezier control points (points of lines), radii (n,),
        normals of ribbons (shape of positions). segments (m,): the first of four (two) points in a
        row, plus 2^31 where the curve goes on before it and 2^30 where it goes on after it: then
        the point before (after) those of the segment says in which direction. uvs (m, 2, 2) at both
        ends; face_materials (m,). Counts as a mesh; arrays are kept as in add_mesh."""
    def add_points(
        self,
        positions: NDArray[np.float32],
        radii: NDArray[np.float32],
        *,
        uvs: NDArray[np.float32] | None = None,
        face_materials: NDArray[np.uint32] | None = None,
        material: int = ...,
        attributes: Mapping[str, tuple[str, NDArray[np.float32]]] = ...,
        name: str = "",
        light_group: str = "",
        asset_length: int = 0,
    ) -> int:
        """Spheres: positions (n, 3), or (steps, n, 3) over the shutter, radii (n,), uvs (n, 2),
        face_materials (n,). Counts as a mesh; arrays are kept as in add_mesh."""
    def add_splats(
        self,
        positions: NDArray[np.float32],
        scales: NDArray[np.float32],
        orientations: NDArray[np.float32],
        opacities: NDArray[np.float32],
        harmonics: NDArray[np.float32],
        *,
        material: int,
        name: str = "",
        light_group: str = "",
        asset_length: int = 0,
    ) -> int:
        """Gaussian splats: middles (n, 3), standard deviations along their axes (n, 3), which are
        positive, quaternions w, x, y, z (n, 4), opacities (n,) from 0 to 1, and real spherical
        harmonics (n, k, 3), k 1, 4, 9 or 16, of what their colour is above 0.5. A material of
        program emissive, which multiplies it. Counts as a mesh; positions and harmonics are kept
        as in add_mesh."""
    def add_group(self, name: str = "", root: str = "") -> int:
        """A new empty group; group 0, the world, is there. root: the prim path that names of what
        is in it begin with, and that names of its instances take the place of."""
    def add_to_group(self, group: int, mesh: int) -> None: ...
    def add_instances(
        self,
        parent: int,
        child: int,
        transforms: NDArray[Any],
        materials: NDArray[np.uint32] | None = None,
        *,
        names: list[str] | None = None,
        numbers: NDArray[np.uint32] | None = None,
        asset_lengths: list[int] | None = None,
        motion: NDArray[np.float64] | None = None,
    ) -> None:
        """Places `child` in `parent` k times: transforms (k, 4, 4); materials (k,) for meshes in it
        that have none of their own. Nested to any depth without copies of geometry. names: prim
        paths, one each or one for all, with numbers (k,) to tell those apart; asset_lengths: as in
        add_mesh, one for each name. motion: (k, s, 4, 4), transforms at s equal steps over the
        shutter, in place of transforms."""
    def add_light(
        self,
        kind: str,
        transform: NDArray[Any],
        *,
        name: str = "",
        # ---- light_table(), of all kinds: tools/update_stub ----
        color: tuple[float, float, float] = (1, 1, 1),
        width: float = 1,
        height: float = 1,
        radius: float = 0.5,
        length: float = 1,
        angle: float = 0.53,
        normalize: bool = False,
        texture: int | None = None,
        group: str = "",
        diffuse: float = 1,
        specular: float = 1,
        focus: float = 0,
        focus_tint: tuple[float, float, float] = (0, 0, 0),
        cone_angle: float = 180,
        cone_softness: float = 0,
        ies: int | None = None,
        ies_angle_scale: float = 0,
        ies_normalize: bool = False,
        light_link: int | None = None,
        shadow_link: int | None = None,
        shadow_color: tuple[float, float, float] = (0, 0, 0),
        shadow_distance: float = -1,
        shadow_falloff: float = -1,
        shadow_falloff_gamma: float = 1,
        filter: int | None = None,
        visible: bool = True,
        motion: NDArray[np.float64] | None = None,
        portals: NDArray[np.float64] | None = None,
        # ---- to here ----
    ) -> int:
        """kind: one of light_kinds(). A parameter that it has not is not looked at.
        wavecomb.light_table says what each is. Raises Error."""
    def add_mesh_light(
        self,
        transform: NDArray[Any],
        material_sync: str,
        *,
        name: str = "",
        # ---- light_table(), of meshes: tools/update_stub ----
        color: tuple[float, float, float] = (1, 1, 1),
        normalize: bool = False,
        diffuse: float = 1,
        specular: float = 1,
        focus: float = 0,
        focus_tint: tuple[float, float, float] = (0, 0, 0),
        cone_angle: float = 180,
        cone_softness: float = 0,
        ies: int | None = None,
        ies_angle_scale: float = 0,
        ies_normalize: bool = False,
        light_link: int | None = None,
        shadow_link: int | None = None,
        shadow_color: tuple[float, float, float] = (0, 0, 0),
        shadow_distance: float = -1,
        shadow_falloff: float = -1,
        shadow_falloff_gamma: float = 1,
        visible: bool = True,
        # ---- to here ----
    ) -> int:
        """A light of the triangles of meshes, for add_mesh. transform: from the light's space, by
        whose -z it is shaped, to that of the mesh's group. material_sync: materialGlowTintsLight,
        independent or noMaterialResponse; give the mesh of the last one an emissive material of
        radiance 1. Others as in add_light; visible: false where it shines
        though rays do not meet the mesh, whose material has constant emission and opacity 0."""
    def add_geometry_set(self, rules: dict[str, str]) -> int:
        """A set for lights, by the rules of a UsdCollectionMembershipQuery: prim paths to
        exclude, explicit or expand."""
    def add_visibility(self, path: str, rays: dict[str, bool]) -> None:
        """Which rays see a prim and what is below it that says nothing else: "camera", "shadow",
        "bounces"; and whether it is a "holdout", where camera rays end and bring nothing."""
    def add_volume(
        self,
        to_world: NDArray[Any],
        *,
        density: VolumeGrid | None = None,
        color: VolumeGrid | None = None,
        emission_grid: VolumeGrid | None = None,
        velocity: VolumeGrid | None = None,
        seconds: tuple[float, float] = (0, 0),
        bounds: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None,
        extinction: tuple[float, float, float] = (1, 1, 1),
        albedo: tuple[float, float, float] = (0.5, 0.5, 0.5),
        emission: tuple[float, float, float] = (0, 0, 0),
        anisotropy: float = 0,
        name: str = "",
    ) -> int:
        """A volume: extinction * density per unit of world length, of which albedo * color is
        scattered by Henyey and Greenstein's phase function of mean cosine ``anisotropy``, and
        radiance emission * emission_grid (or * density) per unit of world length. Without a density
        grid it is 1 all over the box ``bounds``, of the volume's own space. ``velocity``: a grid of
        three components with signs, of the volume's own space over a second: what is at p is what
        the grids have at p - v(p) t, with t from ``seconds``, where the shutter opens and closes.
        ``to_world``: (4, 4), rows. Volumes may overlap. Raises Error that names the volume."""
    def add_ies(
        self, vertical: list[float], horizontal: list[float], candela: NDArray[np.float32]
    ) -> int:
        """A profile for add_light. Angles in degrees, ascending: vertical within [0, 180],
        horizontal from 0 to 360 or a single one; candela (horizontal, vertical). Raises Error."""
    def add_light_filter(
        self,
        transform: NDArray[Any],
        distance: float,
        sides: Sequence[Sequence[float]],
        picture_u: Sequence[float],
        picture_v: Sequence[float],
        texture: int | None,
        decay: Sequence[float],
        density: float,
        next: int | None,
    ) -> int:
        """A filter for add_light: what light passes that crosses z = -distance of its own space at
        (x, y); 0 or less: no such window. sides: four (a, b, c), each of which lets smoothstep(a x
        + b y + c) by. The texture is at u = picture_u . (x, y, 1), v likewise. decay: where light
        begins to arrive and is whole, where it begins to fade and is gone. density: how much of
        all that there is. next: another filter. Raises Error."""
    def set_camera(
        self,
        transform: NDArray[Any],
        *,
        motion: NDArray[np.float64] | None = None,
        # ---- camera_table(): tools/update_stub ----
        # Lens radius in scene units; 0 gives a pinhole camera.
        lens_radius: float = 0,
        # Distance of the focal plane along -z, scene units; above 0 with a lens.
        focus_distance: float = 1,
        # Near clipping distance along -z, scene units; radial for a latlong camera.
        near_clip: float = 0,
        # Far clipping distance along -z, scene units; radial for a latlong camera.
        far_clip: float = 1e30,
        # Visible region (x0, x1, y0, y1): on the plane z = -1, in scene units for an orthographic
        # camera, longitude and latitude in radians for a latlong one.
        window: tuple[float, float, float, float],
        # latlong shows all directions, longitude to the right, latitude up.
        projection: Literal["perspective", "orthographic", "latlong"] = "perspective",
        # How the window is fitted to an image of another aspect ratio: UsdRender's
        # aspectRatioConformPolicy.
        conform: Literal[
            "expandAperture",
            "cropAperture",
            "adjustApertureWidth",
            "adjustApertureHeight",
            "adjustPixelAspectRatio",
        ] = "expandAperture",
        # Pixel width / pixel height.
        pixel_aspect: float = 1,
        # Planes (a, b, c, d) in camera space; camera rays ignore points with a x + b y + c z + d <
        # 0.
        clip_planes: Sequence[Sequence[float]] = [],
        # Factor of the image's radiance.
        exposure: float = 1,
        # Number of corners of the aperture, 3 or more; 0 gives a disk.
        aperture_blades: float = 0,
        # Rotation of the aperture, degrees.
        aperture_rotation: float = 0,
        # Aperture height / aperture width, for anamorphic lenses.
        lens_squeeze: float = 1,
        # Radial distortion, coefficient of r^2 on the plane at distance 1.
        lens_k1: float = 0,
        # Radial distortion, coefficient of r^4.
        lens_k2: float = 0,
        # Radial distortion, coefficient of r^6.
        lens_k3: float = 0,
        # Tangential distortion.
        lens_p1: float = 0,
        # Tangential distortion.
        lens_p2: float = 0,
        # Distortion as a map of n x n nodes over the image, two in each four numbers: positions in
        # fractions of the undistorted image's width and height.
        lens_map: Sequence[Sequence[float]] = [],
        # Image edge at which a rolling shutter begins.
        rolling_shutter: Literal["off", "top", "bottom", "left", "right"] = "off",
        # Fraction of the shutter interval for which a row is exposed.
        rolling_duration: float = 0,
        # ---- to here ----
    ) -> None:
        """Looks along -z. The renderer fits the window to the picture, as conform says. motion:
        (s, 4, 4), transforms at s equal steps over the shutter. Raises Error for names that are not
        known."""
    def build(self) -> Scene:
        """Checks all that spans objects and makes the scene. Raises Error."""

def light_kinds() -> list[tuple[str, tuple[str, ...]]]:
    """Kinds of lights, that of meshes too, each with the types of prims that are drawn as one."""

def material_table() -> list[dict[str, Any]]:
    """The parameters of materials, as wavecomb.material_table.MaterialParameter has them."""

def aov_table() -> list[dict[str, Any]]:
    """What a render can keep beside the beauty, as wavecomb.run.aovs.Aov has it."""

def program_table() -> list[dict[str, Any]]:
    """What programs read, as wavecomb.material_table.Program has it."""

def light_table() -> list[dict[str, Any]]:
    """The parameters of lights, as wavecomb.light_table.LightParameter has them."""

def camera_table() -> list[dict[str, Any]]:
    """The parameters of cameras, as wavecomb.camera_table.CameraParameter has them."""

def setting_table() -> list[dict[str, Any]]:
    """The settings that are one value each, as wavecomb.options.Setting has them."""

class Settings:
    """Settings of a render; attributes as keyword arguments. None sets a default that follows from
    others."""

    # ---- setting_table(): tools/update_stub ----
    width: int
    """Width of the image in pixels. Default: 600."""
    height: int
    """Height of the image in pixels. Default: 600."""
    max_depth: int
    """Maximum number of scattering events of a path. Default: 8."""
    seed: int
    """Seed of all random numbers. Default: 0."""
    sampler: Literal["sobol", "independent"]
    """Pattern of the sample positions. Default: sobol."""
    filter: Literal["box", "gaussian", "blackman-harris"]
    """Pixel filter: weights of samples around a pixel. Default: blackman-harris."""
    @property
    def filter_width(self) -> float:
        """Full filter width in pixels; its own is 1 for the box, else 3. Default: its own."""

    @filter_width.setter
    def filter_width(self, value: float | None) -> None: ...
    clamp_indirect: float
    """Maximum luminance of an indirect contribution. Reduces fireflies but darkens the image.
    Default: off. 0: off."""
    fresnel: Literal["exact", "schlick"]
    """Formula for the reflectance of dielectrics. Default: exact."""
    texture_filter: Literal["auto", "whole"]
    """How textures are filtered. Default: auto."""
    cosine_sampling: bool
    """Samples every non-specular bounce by cosine, for comparisons. Default: False."""
    alpha: bool
    """Makes domes and distant lights transparent to the camera, with an alpha channel. Default:
    False."""
    error: bool
    """Stores error and variance estimates of each pixel. Default: False."""
    overscan: int
    """Extra pixels to render beyond each edge of the image. Default: 0."""
    deep_samples: int
    """Maximum number of samples per pixel of a deep image. Default: 16."""
    deep_tolerance: float
    """Merges samples of a deep image whose depths differ by at most this fraction of the depth.
    Default: 0.01."""
    crop: bool
    """Limits the image, in memory and in files, to the region. Default: False."""
    roulette: Literal["auto", "off", "throughput", "cost-aware", "efficient"]
    """Russian roulette: how paths are terminated early, without bias. Default: auto."""
    transport: Literal["path", "light", "auto", "bdpt"]
    """Where paths start. Default: path."""
    light_aim: Literal["off", "on"]
    """Where light paths are aimed. Default: on."""
    merge_radius: float
    """Radius in pixels within which caustics seen in mirrors or through glass are blurred to find
    them. Default: never. 0: never."""
    firefly: Literal["keep", "reweight"]
    """Treatment of samples much brighter than others. Default: keep."""
    roulette_depth: int
    """First vertex at which roulette may terminate a path. Default: 2."""
    light_selection: Literal["auto", "tree", "power"]
    """How shading chooses the light to sample. Default: auto."""
    light_weights: Literal["calibrated", "power"]
    """How often each light is chosen. Default: calibrated."""
    equiangular: Literal["off", "on"]
    """How scattering distances in homogeneous volumes are sampled. Default: off."""
    guiding: Literal["auto", "on", "off"]
    """Path guiding: bounces also follow the learned incident light. Default: off."""
    learn_memory: int
    """Memory limit of learned data in MB. Default: 64."""
    adaptive: float
    """Samples each pixel until its relative error is below this value. Default: off. 0: off."""
    noise: float
    """Renders until the image's mean relative error is below this value. Default: off. 0: off."""
    min_spp: int
    """Samples per pixel before the first error estimate. Default: 16."""
    spp: int
    """Samples per pixel; the maximum with adaptive sampling. Default: 64."""
    allocate: Literal["even", "error", "efficiency"]
    """How samples are distributed over pixels. Default: even."""
    time_limit: float
    """Stops rendering after this many seconds. Default: none. 0: none."""
    integrator: Literal["wavefront", "reference"]
    """How paths are traced. Default: wavefront."""
    costs: Literal["auto", "measured", "model"]
    """Source of the estimated costs of materials. Default: auto."""
    policy: str
    """The order in which hits are shaded. Default: code."""
    ray_order: Literal["slot", "morton", "morton-octant", "direction", "auto"]
    """The order in which bounce rays are traced. Default: auto."""
    shadow_order: Literal["slot", "morton", "morton-octant", "direction", "auto"]
    """The order in which shadow rays are traced. Default: auto."""
    lanes: int
    """Number of records that are shaded at once. Default: auto. 0: auto."""
    wave_size: int
    """Number of paths that a thread processes together. Default: automatic. 0: automatic."""
    materialize: Literal["auto", "on", "off"]
    """Whether records are moved into their order. Default: auto."""
    traversal: Literal["packets", "single"]
    """How rays are passed to Embree; the image is the same. Default: packets."""
    threads: int
    """Number of render threads. Default: all. 0: all."""
    cost_weight: float
    """Weight of a pass in the moving average of costs. Default: 0.3."""
    progressive: bool
    """Renders passes of 1, 1, 2, 4, ... samples, so that the whole image appears soon. Default:
    False."""
    # ---- to here ----
    region: tuple[int, int, int, int] | None  # x0, y0, x1, y1: the pixels rendered, end excluded
    # Names of aov_table(); "light_NAME" for one light group, "lpe:NAME=EXPRESSION".
    aovs: list[str]
    def __init__(self, **settings: Any) -> None: ...
    def check(self) -> None:
        """Raises Error naming the setting and what it may be."""
    def to_dict(self) -> dict[str, Any]: ...

class Result:
    """Pictures and figures of a render. Row 0 is the top."""

    @property
    def beauty(self) -> NDArray[np.float32]:
        """(height, width, 3), linear Rec.709."""
    @property
    def albedo(self) -> NDArray[np.float32] | None:
        """(height, width, 3); like all AOVs, None where it was not asked for."""
    @property
    def normal(self) -> NDArray[np.float32] | None:
        """(height, width, 3), world space."""
    @property
    def depth(self) -> NDArray[np.float32] | None:
        """(height, width), along the camera's axis; infinite where nothing was hit."""
    @property
    def aovs(self) -> dict[str, NDArray[np.float32]]:
        """Further AOVs that were asked for: (height, width) or (height, width, channels)."""
    @property
    def deep(self) -> tuple[NDArray[np.uint32], NDArray[np.float32]] | None:
        """Samples of each pixel (height, width), and R, G, B, A, Z, ZBack of all samples (n, 6),
        pixel by pixel, the nearest first; None unless the AOV deep was asked for."""
    @property
    def learned(self) -> bytes:
        """What guided it, for `learned` of another render of such a scene; empty: nothing did."""
    @property
    def manifests(self) -> dict[str, dict[str, int]]:
        """Cryptomatte level -> name -> id, of all that the picture holds."""
    @property
    def samples(self) -> NDArray[np.uint32]: ...
    @property
    def error(self) -> NDArray[np.float32] | None:
        """(height, width): what adaptive sampling goes by; infinite: not known. None unless the
        render was adaptive or had the setting ``error``."""
    @property
    def variance(self) -> NDArray[np.float32] | None:
        """(height, width, 3): of each pixel's mean. None likewise."""
    @property
    def cancelled(self) -> bool: ...
    @property
    def costs(self) -> dict[str, dict[str, float]]:
        """{"materials": {name: ns}, "textures": {name: ns}}.

        A profile that a later render can start from.
        """
    @property
    def stats(self) -> dict[str, Any]:
        """Plain ints, floats, strings, lists and dicts; docs/statistics.md has the keys."""

class Snapshot:
    """A render that stands still. Valid while Watcher.snapshot() runs: later it raises Error."""

    @property
    def finished(self) -> bool:
        """There is no more to come."""
    @property
    def status(self) -> dict[str, Any]:
        """samples_done (those of a checkpoint too), samples_total (as expected by now where the
        render is adaptive or timed), resumed_samples, rays, passes, active_pixels, seconds (of this
        run), error (mean relative error at the last look, or None)."""
    def beauty(self) -> NDArray[np.float32]:
        """(height, width, 3), linear; a copy."""
    def samples(self) -> NDArray[np.uint32]:
        """(height, width); a copy."""
    def layer(self, name: str) -> NDArray[Any] | None:
        """A layer as Result and its aovs have it, by name ("depth", "error", "cost" ...), made now;
        None where it is not kept."""
    @property
    def stats(self) -> dict[str, Any]:
        """As Result.stats, so far; error is that of the last look."""
    def state(self) -> dict[str, Any]:
        """All that render(state=...) needs to go on from here: numbers, and arrays of bytes that
        are not copied: they are valid while Watcher.snapshot() runs."""

def render(
    scene: Scene,
    settings: Settings,
    progress: Callable[[int, int], bool | None] | None = None,
    policy: Any = None,
    costs: dict[str, dict[str, float]] | None = None,
    recorder: RayRecording | None = None,
    watcher: Any = None,
    state: dict[str, Any] | None = None,
    interval: float = 0.1,
    learned: bytes | None = None,
) -> Result:
    """Renders; calls progress(samples_done, samples_total) every `interval` seconds on the calling
    thread (GIL held); returning False cancels, and the result holds what was done.
    KeyboardInterrupt raised in the callback also stops the render. Raises Error.
    policy: as wavecomb.SchedulingPolicy, in place of the settings' one; what its order() raises
    comes out of here. costs: a profile to start from, as Result.costs; one that knows all materials
    and textures spares the measuring. recorder: keeps the rays of
    the wavefront integrator. watcher: as run.watcher.Watcher: progress(status) is called like
    progress and answers None, "snapshot" or "stop"; snapshot(snapshot) gets the snapshots that were
    asked for and one at the end. state: of a snapshot of a render with the same settings, to go on
    from. learned: of another Result, to be guided by in place of what would be learned."""

class Renderer:
    """A scene ready to be rendered, and to be changed.

    One thread at a time may call render() and edit(), all else may be called by any thread.

    >>> renderer = wavecomb._core.Renderer(stage.scene)  # doctest: +SKIP
    >>> renderer.edit(materials={0: {"roughness": 0.2}})  # doctest: +SKIP
    >>> renderer.render(wavecomb.Settings(spp=16)).beauty  # doctest: +SKIP
    """

    def __init__(self, scene: Scene, threads: int = 0) -> None:
        """Builds the hierarchy. threads: for that, and for edits; 0: all. Raises Error."""
    @property
    def scene(self) -> Scene:
        """As edited: another object after each edit, which shares with the one before what did not
        change."""
    @property
    def version(self) -> int:
        """Edits so far."""
    def edit(
        self,
        *,
        camera: dict[str, Any] | None = None,
        materials: dict[int, dict[str, Any]] = {},
        lights: dict[int, dict[str, Any]] = {},
    ) -> None:
        """Changes the scene, all at once or nothing. Parameters that are not given stay.

        camera: those of set_camera, or what Scene.camera gives. materials: by id, those of
        add_material but program, name and textures. lights: by index, those of add_light but kind,
        name, texture and group. A picture is then, bit for bit, that of a scene built with these
        values.

        Costs microseconds for a camera and little for materials and colours of lights. Where a mesh
        begins or ceases to be partly present, groups with it are built anew; then, and where a
        light's shape or place changes, the top level, too, with the meshes that no instance holds.
        Raises Error for a bad value, and while a render goes on.
        """
    def render(
        self,
        settings: Settings,
        progress: Callable[[int, int], bool | None] | None = None,
        policy: Any = None,
        costs: dict[str, dict[str, float]] | None = None,
        watcher: Any = None,
        state: dict[str, Any] | None = None,
        interval: float = 0.1,
        picture: bool = True,
        learned: bytes | None = None,
    ) -> Result:
        """As render(), of the scene as it is. picture: False leaves all layers of the result None,
        for a watcher that takes what it needs of snapshots; a render that is stopped ends sooner
        then. Raises Error while another render of this one goes on."""
    def stop(self) -> None:
        """Ends the render that goes on within a wave; it returns what was done. Without one: does
        nothing."""
    def twin(self) -> Renderer:
        """Another renderer of the same scene, to be edited and run by itself. They share hierarchy
        and geometry."""
    def pick(self, x: float, y: float, width: int, height: int) -> dict[str, Any] | None:
        """What the ray through point (x, y) of a picture of that size, (0, 0) being its top left
        corner, meets first; None where it leaves the scene.

        object and asset (names as of Cryptomatte), position, depth (along the camera's axis) and
        distance; of a surface also material (id), material_name, instance (from 1, as the AOV),
        normal and uv; of a light's shape light (index).
        """
    def learned(self, x: float, y: float, width: int, height: int) -> dict[str, Any] | None:
        """What the render that goes on, or else the last one, has learned of the surface that
        ``pick`` finds there; None where there is none, or before anything was learned.

        axis: which way the surface faces, "+x" ... "-z". density: directions that guided bounces
        take, per steradian, (16, 16) float32, rows of Clarberg's square (guiding/directions.h);
        None where the field has no region there; else also guided_share (of bounces) and survival
        (of the learned roulette at throughput 1, 0 where it is not known). light_shares: names of
        lights and emissive meshes with the probability of their choice there, largest first,
        counted in 4,096 choices.
        """

class RayRecording:
    """The rays of one render, kept and traced again; for benchmarks/limit.py."""

    def __init__(self, scene: Scene, byte_limit: int = ...) -> None:
        """Raises Error for a scene with partly present surfaces. A render that would keep more
        than `byte_limit` bytes ends with an Error."""
    @property
    def bytes(self) -> int: ...
    @property
    def waves(self) -> int: ...
    @property
    def rays(self) -> list[int]:
        """Camera and bounce rays of each depth."""
    @property
    def shadow_rays(self) -> list[int]: ...
    def replay(
        self,
        *,
        alone: bool = True,
        threads: int = 0,
        width: tuple[int, int, int] = (16, 16, 16),
        coherent: tuple[bool | None, bool | None, bool | None] = (None, None, None),
    ) -> dict[str, Any]:
        """Traces all rays again, in their order: by Embree alone, or as a render does.

        width, coherent: of camera, bounce and shadow rays; None: as the render had it. Returns
        wall_s, and by kind of ray thread_s, rays and hits. Raises Error for a width that Embree
        does not have here."""

"""Names for Settings.aovs."""

GRAPH_CODES: tuple[str, ...]
"""Operations of value graphs, by number."""
GRAPH_INPUTS: tuple[str, ...]
GRAPH_PARAMETERS: dict[str, tuple[int, int]]
"""Parameter that a graph may drive -> (number of its first component, how many it has)."""
GRAPH_REGISTERS: int
GRAPH_OPS: int
GRAPH_CONSTANT: int
"""An operand with this bit is a constant, else a register."""

def run_graph(
    ops: bytes,
    constants: Sequence[float],
    images: Sequence[tuple[int, float]],
    outputs: Sequence[tuple[int, int]],
    attributes: Sequence[str],
    points: NDArray[np.float32],
    lanes: int = 1,
) -> NDArray[np.float32]:
    """Outputs of a value graph (n, outputs) at points (n, 21): uv, its width, position, local
    position, normal, local normal, tangent, view. Textures are white, attributes are not there.
    ``lanes``: 1 or 16; the results are alike. Raises Error for a graph that reads what
    is not there."""

def walk_albedo(color: float, anisotropy: float) -> float:
    """The albedo of a single collision that gives a half-space a colour under even light."""

def crypto_id(name: str) -> int:
    """A name's id in a Cryptomatte: MurmurHash3 32 with seed 0, made a usual float."""

def lane_widths() -> list[int]: ...
def policies() -> list[str]:
    """Names for Settings.policy."""

def give_back_memory() -> None:
    """Returns freed memory to the system where the C library keeps it."""

def peak_rss_bytes() -> int:
    """The most memory this process has held."""

def build_info() -> dict[str, str]:
    """version, compiler, library (its -march), isa (what its kernels use), tbb."""

MAX_SUBDIVISION: int
"""Highest level of make_surfaces."""

def edge_pixels(
    points: NDArray[np.float32],
    counts: NDArray[np.int32],
    indices: NDArray[np.int32],
    transforms: NDArray[np.float64],
    to_camera: NDArray[np.float64],
    centre: tuple[float, float],
    half: tuple[float, float],
    pixels_per_unit: float,
    projection: str = "perspective",
) -> float:
    """Mean length in pixels of the edges of polygons, long ones counting by their length.

    The greatest over transforms (k, 4, 4) to the world. Edges out of the picture count an eighth.
    to_camera (4, 4), row vectors; centre, half: of the camera's window."""

def split_quads(
    points: NDArray[np.float32],
    indices: NDArray[np.int32],
    starts: NDArray[np.int64] | None = None,
) -> NDArray[np.int64]:
    """Corners (2 k, 3) of the two triangles of each quad, cut along the better diagonal.

    points (n, 3); indices (corners,), in range; starts (k,): first corners, None: all are quads."""

def plain_mesh(
    points: NDArray[np.float32],
    counts: NDArray[np.int32],
    indices: NDArray[np.int32],
    matrix: Any = None,
    *,
    limit: float,
) -> (
    tuple[
        int,
        NDArray[np.float32] | None,
        NDArray[np.float32],
        NDArray[np.int64] | None,
        NDArray[np.uint32] | None,
    ]
    | None
):
    """A mesh of triangles alone or of quads alone; None of any other, and of one with a mistake.

    Corners of each face, 3 or 4; points (n, 3) under a matrix (4, 4) for row vectors, None without
    one; their bounds (2, 3), all within the limit; of quads the corners of ``split_quads`` and the
    points (2 k, 3) that they are at."""

def place_shape(
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    matrix: Any,
    inverse: Any,
    *,
    limit: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]] | None:
    """Points and normals (n, 3) under a matrix (4, 4) for row vectors, whose inverse it is given,
    and the bounds (2, 3) of the points; None where one is not within the limit."""

def used_points(triangles: NDArray[np.uint32], point_count: int) -> NDArray[np.bool_] | None:
    """Which of the points (n,) triangles (m, 3) have; None: all."""

def clip_ears(corners: NDArray[np.float64], most_steps: int = ...) -> tuple[NDArray[np.int64], int]:
    """Triangles (k - 2, 3) of a polygon in the plane, corners (k, 2), counter-clockwise, by
    clipping ears; then how many corners were cut without a look since the steps ran out."""

def weld_corners(
    corners: NDArray[np.int32], point_count: int, values: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Indices (corners,) that join the corners of a point with equal values (corners, width), and
    the values they address."""
