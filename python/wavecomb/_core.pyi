# SPDX-License-Identifier: Apache-2.0
"""The native core, which builds and renders scenes.

Arrays are NumPy arrays; functions say where they do not copy them.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

INHERIT_MATERIAL: int
"""Material id that means the material of the instance."""

class Error(ValueError):
    """Invalid input; the one-line message names the object and says what to do."""

class VolumeGrid:
    """A sparse voxel grid: bricks of 8 x 8 x 8 voxels, and their transform.

    Args:
        origins: (n, 3) index of the first voxel of each brick; distinct multiples of 8.
        values: float16 or float32, (n, 8, 8, 8) or (n, 8, 8, 8, 3): ``values[b, i, j, k]`` is voxel
            ``origins[b] + (i, j, k)``. The value applies at the voxel's index; between indices it
            is interpolated linearly in x, y and z.
        index_to_object: (4, 4) transform from indices to object space, for row vectors.
        background: Value outside of all bricks.
        name: Name for messages.
        is_signed: Whether values may be negative, which velocity grids need.

    Raises Error for values that are negative or not finite, for bricks that are duplicated or not
    at multiples of 8, and for grids with too many bricks.
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
        """Number of stored bricks, which have a border.

        Bricks that equal the background are omitted.
        """
    @property
    def bytes(self) -> int: ...

class Scene:
    """An immutable scene."""

    @property
    def triangles(self) -> int:
        """Number of triangles of all meshes, each counted once."""
    @property
    def instanced_triangles(self) -> int:
        """Number of triangles with every instance counted."""
    @property
    def curve_segments(self) -> int: ...
    @property
    def points(self) -> int: ...
    @property
    def splats(self) -> int: ...
    @property
    def mesh_count(self) -> int:
        """Number of meshes and of prims with curves, points and splats."""
    @property
    def instance_count(self) -> int: ...
    @property
    def volumes(self) -> list[str]:
        """Names of the volumes."""
    @property
    def light_count(self) -> int: ...
    @property
    def lights(self) -> list[tuple[str, str]]:
        """(name, kind) of every light except emissive meshes."""
    @property
    def materials(self) -> list[tuple[str, str]]:
        """(name, program) of every material."""
    @property
    def textures(self) -> list[tuple[str, int]]:
        """(name, bytes) of every texture."""
    def fingerprint(self, arrays: bool = True) -> dict[str, str]:
        """Returns hashes of everything that affects the image, and of names.

        The keys are geometry, materials, textures, lights, camera and names. ``arrays`` includes
        geometry and textures, which requires reading all of their bytes.
        """
    @property
    def camera(self) -> dict[str, Any]:
        """Camera in the form of arguments of `set_camera`, with `to_world` (4, 4) as transform."""
    def material(self, material: int) -> dict[str, Any]:
        """Returns the name, program and parameters of a material as arguments of `add_material`.

        The result includes texture names. The entry ``driven`` lists the parameters that the
        material's value graph computes. Raises Error if the id does not exist.
        """
    def light(self, light: int) -> dict[str, Any]:
        """Returns the name, kind, transform and parameters of a light as arguments of `add_light`.

        The entry `group` is the name of the light group, and `texture` the name of the light's
        texture or None. Raises Error if the index does not exist.
        """
    @property
    def light_groups(self) -> list[str]:
        """Names of light groups; the first, "other", contains lights without a group."""
    @property
    def object_names(self) -> list[tuple[str, str]]:
        """(object, asset) names for Cryptomatte, of all mesh instances, then of all lights."""
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
        """Returns the world bounds of the meshes at and below a prim; None if there are none."""

class TextureStore:
    """Limits the memory of textures and swaps the rest to a temporary file."""

    def __init__(self, limit_bytes: int, folder: str) -> None:
        """``folder`` is for the swap file, created when textures exceed the limit. Raises Error."""
    @staticmethod
    def obstacle() -> str:
        """Returns the reason why this system cannot swap textures, or ""."""
    @property
    def limit_bytes(self) -> int: ...
    def set_waiting(self, bytes: int) -> None:
        """Counts the bytes of images that are not yet textures towards the memory limit."""
    @property
    def statistics(self) -> dict[str, float]:
        """Current values of ``texture_store`` in docs/statistics.md."""

class SceneBuilder:
    """Collects the objects of a scene; ids start at 0 and increase in order of calls.

    Transforms follow USD's row-vector convention (translation in the last row), float64 or float32,
    shape (4, 4).
    """

    def __init__(self, threads: int = 0, store: TextureStore | None = None) -> None:
        """``store`` limits the memory of added textures; None keeps all in memory."""
    def add_texture(
        self,
        pixels: NDArray[Any],
        *,
        srgb: bool,
        wrap_s: str = "repeat",
        wrap_t: str = "repeat",
        name: str = "",
    ) -> int:
        """Adds an image (height, width, 1 to 4 channels): uint8, float16 or float32, top row first.

        Wrap modes are repeat, clamp, mirror and black. ``srgb`` matters for uint8 only. The texture
        is stored in tiles with mip levels.
        """
    def add_tiles(
        self,
        name: str,
        tiles: list[tuple[int, int]],
        missing: tuple[float, ...],
    ) -> int:
        """Adds a UDIM texture from added textures: (tile number, texture id).

        ``missing`` is the linear r, g, b and alpha of missing tiles.
        """

    def share_texture(self, scene: Scene, texture: int) -> int:
        """Adds a texture of another scene by its id there, without a copy. Raises Error."""
    def add_graph(
        self,
        ops: bytes,
        constants: Sequence[float],
        images: Sequence[tuple[int, float]],
        outputs: Sequence[tuple[int, int]],
        attributes: Sequence[str] = (),
    ) -> int:
        """Adds a value graph for ``add_material``.

        ``ops`` are operations of 16 bytes, as GraphOp of graph/graph.h; ``images`` are (texture,
        stretch); ``outputs`` are (component of GRAPH_PARAMETERS, operand); ``attributes`` are names
        of mesh attributes. Raises Error for a graph that refers to missing objects.
        """
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
        """Programs: diffuse, metal, dielectric, plastic, emissive, principled, openpbr, hair.

        textures: slot -> {"texture": id, "channel": "rgb"|"r"|"g"|"b"|"a", "scale": 4 floats,
        "bias": 4 floats, "uv": 6 floats}; value = texel * scale + bias at u' = uv[0] u + uv[1] v +
        uv[2], v' = uv[3] u + uv[4] v + uv[5]. Slots: base_color, specular_color, emission,
        roughness, metallic, clearcoat, clearcoat_roughness, opacity, normal (tangent space, value
        in [-1, 1] after scale and bias).

        For a metal, base_color is the reflectance at normal incidence and specular_color the tint
        at 82 degrees (black means untinted).

        openpbr, for the program of that name: diffuse_roughness, specular_weight, anisotropy,
        rotation (turns), transmission_weight, transmission_color, transmission_depth,
        subsurface_weight, subsurface_color, subsurface_radius (mean free paths; 0 means diffuse),
        subsurface_anisotropy, fuzz_weight, fuzz_color, fuzz_roughness, coat_color, coat_ior,
        coat_darkening, film_weight, film_thickness (nanometres), film_ior, thin_walled. The coat of
        openpbr uses clearcoat and clearcoat_roughness.
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
        """Adds a mesh and returns its id.

        positions: (n, 3), or (s, n, 3) at s equal steps over the shutter. indices: triangles (m,
        3), counter-clockwise when seen from outside. normals: (n, 3) per vertex or (m, 3, 3) per
        corner, with a leading axis of steps if positions have one. uvs: (n, 2) or (m, 3, 2).
        face_materials: (m,).

        attributes: name -> (rate, values (k, c) of 1 to 4 components), with the rates "constant" (k
        = 1), "primitive" (m), "vertex" (n) and "corner" (3 m); curves have the rate "end" (2 m)
        instead of "vertex" and "corner".

        C-ordered arrays of these types are not copied but kept alive; do not modify them
        afterwards. light_group: light group of its emission. asset_length: length of the asset's
        path within its name, a prim path; 0 if unknown. mesh_light: a result of add_mesh_light.
        """
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
        """Adds meshes that have only points and one material each; returns the first id.

        positions (n, 3) and indices (m, 3) contain one mesh after another, with the given numbers
        of points and triangles; indices are relative to the mesh's first point. groups: group of
        each mesh, or 0xffffffff for none. The arguments materials, asset_lengths and names have one
        value for each mesh.
        """
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
        """Replaces the arrays of a mesh; `add_mesh` describes their shapes.

        The name and groups of the mesh are unchanged.
        """
    def make_surfaces(
        self, descriptions: list[dict[str, Any]], threads: int = 0
    ) -> list[dict[str, Any] | str]:
        """Converts subdivision surfaces and displaced polygons to triangle meshes, in parallel.

        Each description has level (0 means polygons), points (n, 3) float32, counts (faces,) and
        indices (corners,) int32, left_handed. From level 1 on it also has scheme, boundary,
        face_varying (tokens of UsdGeomMesh), smooth_triangles, and optionally holes, crease_edges
        (k, 2) int32 with crease_sharpness (k,) float32, corner_vertices and corner_sharpness. At
        level 0 it has triangles (m, 3) and triangle_faces (m,) uint32, and triangle_corners (m *
        3,) for face-varying uvs.

        Optional entries: matrix (4, 4) float64 for row vectors; uvs, and a list primvars, of
        {"interpolation": "vertex", "varying" or "faceVarying", "values": (k, width) float32,
        "width", "indices": (corners,) int32 if face-varying}; displacements, a list of lengths and
        of texture uses in the form of add_material, and face_displacement (faces,) int32, an index
        into that list or -1 for none. At level 0, values of face-varying primvars are those of the
        triangles' corners (3 m, width), without indices.

        Returns for each description either a message why there is no mesh, or positions, normals,
        uvs (or None), triangles, faces (m,) (cage face of each triangle), primvars (attributes in
        the form of add_mesh, "vertex" or "corner"), and manifold (False if edges or points had to
        be kept sharp).
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
        """Adds curves and returns their id; they count as a mesh.

        Kinds: linear-tube, cubic-tube, linear-ribbon, cubic-ribbon. positions: (n, 3), or (steps,
        n, 3) over the shutter, Bezier control points or points of lines. radii: (n,). normals:
        shape of positions, for ribbons.

        segments: (m,) index of the first point of each segment, which has four consecutive points
        (two for lines), plus 2^31 if the curve continues before the segment and 2^30 if it
        continues after it; the adjacent point then gives the direction. uvs: (m, 2, 2) at both
        ends. face_materials: (m,). The arrays are not copied but kept alive; do not modify them
        afterwards.
        """
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
        """Adds spheres and returns their id; they count as a mesh.

        positions: (n, 3), or (steps, n, 3) over the shutter. radii: (n,). uvs: (n, 2).
        face_materials: (n,). The arrays are not copied but kept alive; do not modify them
        afterwards.
        """
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
        """Adds Gaussian splats and returns their id; they count as a mesh.

        positions: centres (n, 3). scales: positive standard deviations along the axes (n, 3).
        orientations: quaternions w, x, y, z (n, 4). opacities: (n,) from 0 to 1. harmonics: real
        spherical harmonics (n, k, 3) of the colour minus 0.5, with k 1, 4, 9 or 16. material: of
        program emissive, which multiplies the radiance. positions and harmonics are not copied but
        kept alive; do not modify them afterwards.
        """
    def add_group(self, name: str = "", root: str = "") -> int:
        """Adds an empty group; group 0, the world, always exists.

        ``root`` is a prim path with which names of the group's meshes begin. In each instance of
        the group, the name of the instance replaces this path.
        """
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
        """Adds k instances of `child` to `parent`.

        transforms: (k, 4, 4). materials: (k,) for meshes without a material. Instances may be
        nested to any depth, and geometry is never copied. names: prim paths, one per instance, or
        one for all with numbers (k,) that distinguish them. asset_lengths: as in add_mesh, one per
        name. motion: (k, s, 4, 4) transforms at s equal steps over the shutter, which replace
        transforms.
        """
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
        visible_to_camera: bool = True,
        motion: NDArray[np.float64] | None = None,
        portals: NDArray[np.float64] | None = None,
        # ---- to here ----
    ) -> int:
        """Adds a light of a kind of light_kinds(); ignores parameters that the kind does not have.

        wavecomb.core_table describes the parameters. Raises Error.
        """
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
        """Adds a mesh light and returns its id, which is the argument `mesh_light` of `add_mesh`.

        transform: from light space, in which shaping is relative to -z, to the mesh's group.
        material_sync: materialGlowTintsLight, independent or noMaterialResponse; with
        noMaterialResponse the mesh needs an emissive material of radiance 1. visible: False if the
        mesh emits but is invisible to rays; its material then has constant emission and opacity 0.
        The remaining parameters have the same meaning as in `add_light`.
        """
    def add_geometry_set(self, rules: dict[str, str]) -> int:
        """Adds a set of prims for light linking and shadow linking.

        ``rules`` maps prim paths to "exclude", "explicit" or "expand", the rules of a
        UsdCollectionMembershipQuery.
        """
    def add_visibility(self, path: str, rays: dict[str, bool]) -> None:
        """Sets the ray visibility of a prim and of those descendants that have no setting.

        The keys of ``rays`` are "camera", "shadow" and "bounces", for the rays that see the prim,
        and "holdout", which ends camera rays at the prim without radiance.
        """
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
        """Adds a volume.

        The extinction coefficient is extinction * density per unit of world length, the
        single-scattering albedo is albedo * color, and the phase function is that of Henyey and
        Greenstein with mean cosine ``anisotropy``. The emitted radiance is emission * emission_grid
        (or * density) per unit of world length. Without a density grid, density is 1 in the box
        ``bounds`` in object space. Volumes may overlap.

        ``velocity``: grid of signed vectors in object-space units per second. The value at p and
        time t is that of the grids at p - v(p) t; ``seconds`` are the opening and closing times of
        the shutter. ``to_world``: (4, 4) for row vectors. Raises Error if an argument is invalid;
        the message names the volume.
        """
    def add_ies(
        self, vertical: list[float], horizontal: list[float], candela: NDArray[np.float32]
    ) -> int:
        """Adds an IES profile for add_light.

        Angles are in degrees, ascending: vertical within [0, 180], horizontal from 0 to 360 or a
        single angle. candela: (horizontal, vertical). Raises Error.
        """
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
        """Adds a light filter for add_light.

        The filter acts on light that crosses the plane z = -distance of filter space at (x, y); a
        distance of 0 or less means that there is no such window. sides: four (a, b, c), each of
        which transmits smoothstep(a x + b y + c). The texture is read at u = dot(picture_u, p) and
        v = dot(picture_v, p) for p = (x, y, 1). decay: distances at which light starts to appear,
        is complete, starts to fade, and vanishes. density: strength of the filter. next: id of
        another filter that acts on the same light, or None. Raises Error.
        """
    def set_camera(
        self,
        transform: NDArray[Any],
        *,
        motion: NDArray[np.float64] | None = None,
        # ---- camera_table(): tools/update_stub ----
        # Lens radius in scene units; 0 gives a pinhole camera.
        lens_radius: float = 0,
        # Distance of the focal plane along -z in scene units; must be above 0 if the lens radius is
        # above 0.
        focus_distance: float = 1,
        # Near clipping distance in scene units: along -z, or from the centre of a latlong camera.
        near_clip: float = 0,
        # Far clipping distance in scene units: along -z, or from the centre of a latlong camera.
        far_clip: float = 1e30,
        # Visible region (x0, x1, y0, y1) of a camera: on the plane z = -1 for perspective, in scene
        # units for orthographic, in radians of longitude and latitude for latlong.
        window: tuple[float, float, float, float],
        # Projection of the camera; latlong shows all directions, with longitude to the right and
        # latitude up.
        projection: Literal["perspective", "orthographic", "latlong"] = "perspective",
        # How the camera window is fitted to an image of another aspect ratio (UsdRender's
        # aspectRatioConformPolicy).
        conform: Literal[
            "expandAperture",
            "cropAperture",
            "adjustApertureWidth",
            "adjustApertureHeight",
            "adjustPixelAspectRatio",
        ] = "expandAperture",
        # Aspect ratio of a pixel, width / height.
        pixel_aspect: float = 1,
        # Clipping planes (a, b, c, d) in camera space; camera rays ignore points with a x + b y + c
        # z + d < 0.
        clip_planes: Sequence[Sequence[float]] = [],
        # Factor by which the camera scales the radiance of the image.
        exposure: float = 1,
        # Number of corners of the lens aperture, 3 or more; 0 gives a circular aperture.
        aperture_blades: float = 0,
        # Rotation of the lens aperture in degrees.
        aperture_rotation: float = 0,
        # Height / width of the lens aperture, for anamorphic lenses.
        lens_squeeze: float = 1,
        # Coefficient of r^2 in the radial lens distortion, on the plane at distance 1.
        lens_k1: float = 0,
        # Coefficient of r^4 in the radial lens distortion.
        lens_k2: float = 0,
        # Coefficient of r^6 in the radial lens distortion.
        lens_k3: float = 0,
        # First coefficient of the tangential lens distortion.
        lens_p1: float = 0,
        # Second coefficient of the tangential lens distortion.
        lens_p2: float = 0,
        # Lens distortion map of n x n nodes, two in each row of four numbers; a node is a position
        # in the undistorted image, in fractions of its width and height.
        lens_map: Sequence[Sequence[float]] = [],
        # Image edge at which the exposure of a rolling shutter begins.
        rolling_shutter: Literal["off", "top", "bottom", "left", "right"] = "off",
        # Fraction of the shutter interval for which a rolling shutter exposes each pixel row.
        rolling_duration: float = 0,
        # ---- to here ----
    ) -> None:
        """Sets the camera, which looks along -z.

        `conform` determines how the renderer fits the camera's window to the aspect ratio of the
        image. motion: (s, 4, 4) transforms at s equal steps over the shutter. Raises Error for
        unknown parameter names.
        """
    def build(self) -> Scene:
        """Validates the scene as a whole and builds it. Raises Error."""

def light_kinds() -> list[tuple[str, tuple[str, ...]]]:
    """Returns the kinds of lights, including mesh lights, with their USD prim types."""

def material_table() -> list[dict[str, Any]]:
    """Returns the parameters of materials, fields of wavecomb.core_table.MaterialParameter."""

def aov_table() -> list[dict[str, Any]]:
    """Returns the AOVs besides beauty, as fields of wavecomb.run.aovs.Aov."""

def program_table() -> list[dict[str, Any]]:
    """Returns the shading programs, as fields of wavecomb.core_table.Program."""

def light_table() -> list[dict[str, Any]]:
    """Returns the parameters of lights, as fields of wavecomb.core_table.LightParameter."""

def camera_table() -> list[dict[str, Any]]:
    """Returns the parameters of cameras, as fields of wavecomb.core_table.CameraParameter."""

def setting_table() -> list[dict[str, Any]]:
    """Returns the settings with a single value, as fields of wavecomb.options.Setting."""

class Settings:
    """Settings of a render; attributes are keyword arguments.

    None selects a default that depends on other settings.
    """

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
    """Generator of sample positions: low-discrepancy points or independent random numbers. Default:
    sobol."""
    filter: Literal["box", "gaussian", "blackman-harris"]
    """Pixel filter, which weights the samples around a pixel. Default: blackman-harris."""
    @property
    def filter_width(self) -> float:
        """Full width of the pixel filter in pixels; the default is 1 for box, 3 for other filters.
        Default: depends on other settings."""

    @filter_width.setter
    def filter_width(self, value: float | None) -> None: ...
    clamp_indirect: float
    """Clamps indirect contributions to this luminance, which reduces fireflies but darkens the
    image. Default: off. 0: off."""
    fresnel: Literal["exact", "schlick"]
    """Formula for the reflectance of dielectrics. Default: exact."""
    texture_filter: Literal["auto", "whole"]
    """Hits that use full texture filtering. Default: auto."""
    cosine_sampling: bool
    """Samples non-specular bounces with a cosine-weighted density instead of the BSDF, for
    comparisons. Default: False."""
    alpha: bool
    """Makes dome and distant lights transparent to the camera, and adds an alpha channel. Default:
    False."""
    error: bool
    """Stores estimates of the error and variance of each pixel. Default: False."""
    overscan: int
    """Extra pixels to render beyond each edge of the image. Default: 0."""
    deep_samples: int
    """Maximum number of samples per pixel of a deep image. Default: 16."""
    deep_tolerance: float
    """Merges samples of a deep image whose depths differ by at most this fraction of the depth.
    Default: 0.01."""
    crop: bool
    """Stores only the pixels of the render region, in memory and in files. Default: False."""
    roulette: Literal["auto", "off", "throughput", "cost-aware", "efficient"]
    """Russian roulette, which terminates paths early without bias. Default: auto."""
    shadow_roulette: Literal["off", "on"]
    """Whether Russian roulette saves shadow rays. Default: on."""
    quality: Literal["auto", "plain"]
    """Whether short pilot renders decide if path guiding and light paths are used. Default:
    auto."""
    transport: Literal["path", "light", "auto", "bdpt"]
    """Whether paths start at the camera only or also at the lights. Default: auto."""
    light_aim: Literal["off", "on"]
    """How the starting points and directions of light paths are chosen. Default: on."""
    light_splats: Literal["auto", "filtered", "pixel"]
    """How light paths add light to the pixels around a point that the camera sees. Default:
    auto."""
    merge_radius: float
    """Radius in pixels of path merging, which finds caustics in mirrors, but blurs them. Default:
    0."""
    auto_merge: Literal["off", "on"]
    """Whether light paths are merged if pilot renders predict a gain. Default: on."""
    firefly: Literal["keep", "reweight"]
    """Treatment of samples that are much brighter than their neighbours. Default: keep."""
    roulette_depth: int
    """First path vertex at which Russian roulette may terminate a path. Default: 2."""
    light_selection: Literal["auto", "tree", "power"]
    """Method that chooses which light to sample at a shading point. Default: auto."""
    light_weights: Literal["calibrated", "power"]
    """Weights of the lights in light selection. Default: calibrated."""
    equiangular: Literal["off", "on"]
    """How scattering distances in homogeneous volumes are sampled. Default: off."""
    guiding: Literal["auto", "on", "off"]
    """Path guiding, which samples some bounce directions by learned incident light. Default:
    auto."""
    learn_memory: int
    """Memory limit of the path guiding field in MB. Default: 64."""
    adaptive: float
    """Samples each pixel until its relative error is below this value. Default: off. 0: off."""
    noise: float
    """Renders until the image's mean relative error is below this value. Default: off. 0: off."""
    min_spp: int
    """Samples per pixel before adaptive sampling estimates errors for the first time. Default:
    16."""
    spp: int
    """Number of samples per pixel, or the maximum with adaptive sampling. Default: 64."""
    allocate: Literal["even", "error", "efficiency"]
    """How samples are distributed over pixels. Default: even."""
    time_limit: float
    """Stops rendering after this many seconds. Default: none. 0: none."""
    integrator: Literal["wavefront", "reference"]
    """Integrator that traces the paths. Default: wavefront."""
    costs: Literal["auto", "measured", "model"]
    """Source of the estimated shading costs of materials. Default: auto."""
    policy: str
    """The order in which hits are shaded. Default: code."""
    ray_order: Literal["slot", "morton", "morton-octant", "direction", "auto"]
    """The order in which bounce rays are traced. Default: auto."""
    shadow_order: Literal["slot", "morton", "morton-octant", "direction", "auto"]
    """The order in which shadow rays are traced. Default: auto."""
    lanes: int
    """Number of SIMD lanes, each of which shades one hit. Default: auto. 0: auto."""
    wave_size: int
    """Number of paths in a wave, which one thread processes together. Default: automatic. 0:
    automatic."""
    materialize: Literal["auto", "on", "off"]
    """Whether shading inputs are copied into the order of shading. Default: auto."""
    traversal: Literal["packets", "single"]
    """Whether Embree traces rays in packets or one by one, which does not change the image.
    Default: packets."""
    threads: int
    """Number of render threads. Default: all. 0: all."""
    cost_weight: float
    """Weight of the latest pass in the moving average of shading costs. Default: 0.3."""
    progressive: bool
    """Renders passes of 1, 1, 2, 4, ... samples per pixel, so that the whole image appears soon.
    Default: False."""
    # ---- to here ----
    # pixel rectangle x0, y0, x1, y1 to render, without row y1 and column x1
    region: tuple[int, int, int, int] | None
    # AOVs to render: names from aov_table(), "light_NAME" for the light group NAME, and
    # "lpe:NAME=EXPRESSION" for a light path expression.
    aovs: list[str]
    def __init__(self, **settings: Any) -> None: ...
    def check(self) -> None:
        """Raises Error that names an invalid setting and its valid values."""
    def to_dict(self) -> dict[str, Any]: ...

class Result:
    """Layers and statistics of a render. Row 0 is the top."""

    @property
    def beauty(self) -> NDArray[np.float32]:
        """(height, width, 3), linear Rec.709."""
    @property
    def albedo(self) -> NDArray[np.float32] | None:
        """Array (height, width, 3). It is None, as all AOVs are, if it was not requested."""
    @property
    def normal(self) -> NDArray[np.float32] | None:
        """(height, width, 3), world space."""
    @property
    def depth(self) -> NDArray[np.float32] | None:
        """(height, width), depth along the camera's axis; infinite for pixels without a hit."""
    @property
    def aovs(self) -> dict[str, NDArray[np.float32]]:
        """Further requested AOVs: (height, width) or (height, width, channels)."""
    @property
    def deep(self) -> tuple[NDArray[np.uint32], NDArray[np.float32]] | None:
        """Sample counts (height, width), and R, G, B, A, Z, ZBack of all samples (n, 6).

        Samples are in pixel order, the closest first. The property is None unless the AOV `deep`
        was requested.
        """
    @property
    def learned(self) -> bytes:
        """Guiding field for the argument `learned` of `render`; empty without path guiding."""
    @property
    def manifests(self) -> dict[str, dict[str, int]]:
        """Cryptomatte level -> name -> id of all objects in the image."""
    @property
    def samples(self) -> NDArray[np.uint32]: ...
    @property
    def error(self) -> NDArray[np.float32] | None:
        """(height, width) error estimate of adaptive sampling; infinite if unknown.

        The property is None unless the render was adaptive or had the setting ``error``.
        """
    @property
    def variance(self) -> NDArray[np.float32] | None:
        """(height, width, 3) variance of each pixel's mean. The array is None in the same cases as
        ``error``."""
    @property
    def cancelled(self) -> bool: ...
    @property
    def costs(self) -> dict[str, dict[str, float]]:
        """Cost profile {"materials": {name: ns}, "textures": {name: ns}}.

        A later render can start from this profile.
        """
    @property
    def stats(self) -> dict[str, Any]:
        """Statistics as plain Python values; docs/statistics.md has the keys."""

class Snapshot:
    """State of a paused render, valid only during Watcher.snapshot(). After the call returns, any
    use of the snapshot raises Error."""

    @property
    def finished(self) -> bool:
        """Whether the render is complete."""
    @property
    def status(self) -> dict[str, Any]:
        """Progress of the render.

        Keys: samples_done (including those of a checkpoint), samples_total (an estimate for
        adaptive or timed renders), resumed_samples, rays, passes, active_pixels, seconds (of this
        run), and error (the last estimate of the mean relative error, or None).
        """
    def beauty(self) -> NDArray[np.float32]:
        """Returns a copy of the image in linear colours, (height, width, 3)."""
    def samples(self) -> NDArray[np.uint32]:
        """Returns a copy of the sample counts of pixels, (height, width)."""
    def layer(self, name: str) -> NDArray[Any] | None:
        """Computes the current values of a layer of `Result`, such as "depth" or "error".

        Returns None if the render does not keep this layer.
        """
    @property
    def stats(self) -> dict[str, Any]:
        """Current values of `Result.stats`; the entry `error` is the last estimate."""
    def state(self) -> dict[str, Any]:
        """Returns the state of the render, with which `render(state=...)` continues it.

        The state contains numbers and byte arrays. The arrays are not copied, and are valid only
        during `Watcher.snapshot()`.
        """

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
    """Renders a scene. Raises Error.

    progress: called as progress(samples_done, samples_total) every `interval` seconds on the
    calling thread with the GIL held. Returning False cancels the render; the result then holds the
    finished samples. KeyboardInterrupt in the callback also stops the render.

    policy: a wavecomb.SchedulingPolicy that replaces the policy of the settings; render() raises
    exceptions of its method order(). costs: initial profile in the form of Result.costs; a profile
    with all materials and textures makes cost measurements unnecessary. recorder: records the rays
    of the wavefront integrator.

    watcher: a run.watcher.Watcher. Its progress(status) is called like progress and returns None,
    "snapshot" or "stop"; its snapshot(snapshot) receives requested snapshots and one at the end.
    state: state of a snapshot from a render with the same settings, from which this render
    continues. learned: guiding field of another Result; with it, this render trains no field.
    """

class Renderer:
    """A scene with acceleration structures that can be rendered and edited.

    Only one thread at a time may call render() and edit(); other methods are thread-safe.

    >>> renderer = wavecomb._core.Renderer(stage.scene)  # doctest: +SKIP
    >>> renderer.edit(materials={0: {"roughness": 0.2}})  # doctest: +SKIP
    >>> renderer.render(wavecomb.Settings(spp=16)).beauty  # doctest: +SKIP
    """

    def __init__(self, scene: Scene, threads: int = 0) -> None:
        """Builds acceleration structures. threads: number of threads for building and edits; 0
        means all.

        Raises Error.
        """
    @property
    def scene(self) -> Scene:
        """Current scene. Each edit makes a new object, which shares unchanged data with the old."""
    @property
    def version(self) -> int:
        """Number of edits."""
    def edit(
        self,
        *,
        camera: dict[str, Any] | None = None,
        materials: dict[int, dict[str, Any]] = {},
        lights: dict[int, dict[str, Any]] = {},
        moves: dict[str, ArrayLike] = {},
    ) -> None:
        """Changes the scene atomically. Parameters that are not given are unchanged.

        camera: arguments of set_camera, or a value of Scene.camera. materials: arguments of
        add_material by id, except program, name and textures. lights: arguments of add_light by
        index, except kind, name, texture and group. moves: maps prim paths to transforms (4, 4) in
        world space, which are applied to all objects and lights at or below the prim after their
        transforms in the first scene. A render after an edit is bit-identical to one of a scene
        that was built with these values; once an object was moved, all meshes outside of groups
        count as instances in that scene.

        A camera edit takes microseconds, and edits of materials and light colours take little time.
        If a mesh starts or stops being partially present, the groups that contain it are rebuilt.
        In that case, and if the shape or position of a light changes, the top level with all meshes
        outside of instances is rebuilt as well. The first move of an object builds a hierarchy of
        these meshes; later moves rebuild the top level over the instances only. Raises Error for an
        invalid value, and during a render.
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
        """Renders the current scene; the arguments are those of the function render().

        picture: False leaves all layers of the result None, for watchers that use only snapshots;
        stopping such a render is faster. Raises Error during another render of this object.
        """
    def stop(self) -> None:
        """Stops the current render within one wave; render() then returns the finished samples.

        Without a running render the call has no effect.
        """
    def twin(self) -> Renderer:
        """Returns another renderer of the scene with separate edits.

        Acceleration structures are shared.
        """
    def pick(self, x: float, y: float, width: int, height: int) -> dict[str, Any] | None:
        """Returns the first hit of the ray through a point of an image of the given size.

        (0, 0) is the top left corner. Returns None if the ray leaves the scene. Keys: object and
        asset (names as in Cryptomatte), position, depth (along the camera's axis) and distance; for
        surfaces also material (id), material_name, instance (from 1, as in the AOV), normal and uv;
        for the shape of a light also light (index).
        """
    def learned(self, x: float, y: float, width: int, height: int) -> dict[str, Any] | None:
        """Returns data of path guiding and light selection at the surface that ``pick`` returns.

        The data are those of the current or last render. Returns None without a surface or before
        training. Keys: axis, the dominant axis of the normal, "+x" ... "-z". density: density of
        guided bounces per steradian, (16, 16) float32, rows of Clarberg's square
        (guiding/directions.h); None if the guiding field has no region there. With a region also
        guided_share (the fraction of guided bounces) and survival (of the trained roulette at
        throughput 1; 0 if unknown). light_shares: names of lights and emissive meshes with their
        selection probabilities there, largest first, estimated from 4,096 selections.
        """

class RayRecording:
    """Recorder of the rays of a render, which `replay` traces again; for benchmarks/limit.py."""

    def __init__(self, scene: Scene, byte_limit: int = ...) -> None:
        """Raises Error for a scene with partially present surfaces.

        A render that would record more than `byte_limit` bytes ends with an Error.
        """
    @property
    def bytes(self) -> int: ...
    @property
    def waves(self) -> int: ...
    @property
    def rays(self) -> list[int]:
        """Number of camera and bounce rays at each depth."""
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
        """Traces all rays again in their order: with Embree alone, or as in a render.

        width, coherent: packet width and coherence flag of camera, bounce and shadow rays; None
        uses those of the render. Returns wall_s, and thread_s, rays and hits by kind of ray. Raises
        Error for a width that Embree does not support here.
        """

"""Names for Settings.aovs."""

GRAPH_CODES: tuple[str, ...]
"""Names of value graph operations, by code."""
GRAPH_INPUTS: tuple[str, ...]
GRAPH_PARAMETERS: dict[str, tuple[int, int]]
"""Parameter that a graph may drive -> (index of its first component, number of components)."""
GRAPH_REGISTERS: int
GRAPH_OPS: int
GRAPH_CONSTANT: int
"""Bit of an operand that refers to a constant instead of a register."""

def run_graph(
    ops: bytes,
    constants: Sequence[float],
    images: Sequence[tuple[int, float]],
    outputs: Sequence[tuple[int, int]],
    attributes: Sequence[str],
    points: NDArray[np.float32],
    lanes: int = 1,
) -> NDArray[np.float32]:
    """Evaluates a value graph at points (n, 21); returns (n, outputs).

    The 21 values are the texture coordinates and their filter width, the position and normal in
    world and local space, the tangent and the view direction. Textures are white and attributes are
    missing. ``lanes`` is 1 or 16 and does not change results. Raises Error for a graph that refers
    to missing objects.
    """

def walk_albedo(color: float, anisotropy: float) -> float:
    """Returns the single-scattering albedo that gives a half-space a colour under uniform light."""

def crypto_id(name: str) -> int:
    """Returns the Cryptomatte id of a name: MurmurHash3 32 with seed 0, as a normal float."""

def lane_widths() -> list[int]: ...
def policies() -> list[str]:
    """Returns names for Settings.policy."""

def give_back_memory() -> None:
    """Returns freed memory that the C library caches to the operating system."""

def peak_rss_bytes() -> int:
    """Returns the peak memory of this process in bytes."""

def build_info() -> dict[str, str]:
    """Returns the version, the compiler, the -march option of the library, the instruction set of
    its kernels, and the version of TBB."""

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
    """Returns the mean length in pixels of polygon edges, weighted by length.

    The result is the maximum over transforms (k, 4, 4) to the world. Edges outside of the image
    have a weight of 1/8. to_camera: (4, 4) for row vectors. centre, half: centre and half extent of
    the camera's window.
    """

def split_quads(
    points: NDArray[np.float32],
    indices: NDArray[np.int32],
    starts: NDArray[np.int64] | None = None,
) -> NDArray[np.int64]:
    """Returns corners (2 k, 3) of the two triangles of each quad, split along the better diagonal.

    points: (n, 3). indices: (corners,), in range. starts: (k,) first corners; None if all faces are
    quads.
    """

def plain_mesh(
    points: NDArray[np.float32],
    counts: NDArray[np.int32],
    indices: NDArray[np.int32],
    matrix: Any,
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
    """Converts a mesh of triangles or of quads; returns None for mixed and invalid meshes.

    Returns the number of corners per face, 3 or 4; points (n, 3) transformed by a matrix (4, 4) for
    row vectors, None if it is the identity; their bounds (2, 3), all within the limit; and for
    quads the corners of ``split_quads`` and their point indices (2 k, 3).
    """

def plain_meshes(
    points: NDArray[np.float32],
    counts: NDArray[np.int32],
    indices: NDArray[np.int32],
    sizes: NDArray[np.uint32],
    matrices: NDArray[np.float64],
    *,
    limit: float,
) -> tuple[
    NDArray[np.float32],
    NDArray[np.uint32],
    NDArray[np.uint32],
    NDArray[np.float32],
    NDArray[np.uint8],
]:
    """Converts the first g of k meshes, up to the first that ``plain_mesh`` cannot convert.

    points, counts and indices hold one mesh after another; sizes (k, 3) are the numbers of points,
    faces and corners of each; matrices have the shape (k, 4, 4).

    Returns points (n, 3); point indices (m, 3) of triangles, relative to the mesh's first point;
    the number of triangles of each mesh (g,); bounds (2 g, 3); and for each mesh (g,) whether its
    triangles use all its points.
    """

def place_shape(
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    matrix: Any,
    inverse: Any,
    *,
    limit: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]] | None:
    """Transforms points and normals (n, 3) by a matrix (4, 4) for row vectors with a given inverse.

    Also returns the bounds (2, 3) of the points. Returns None if a point exceeds the limit.
    """

def used_points(triangles: NDArray[np.uint32], point_count: int) -> NDArray[np.bool_] | None:
    """Returns a mask (n,) of the points that triangles (m, 3) use; None if all are used."""

def clip_ears(corners: NDArray[np.float64], most_steps: int = ...) -> tuple[NDArray[np.int64], int]:
    """Splits a plane polygon (k, 2), counter-clockwise, into triangles (k - 2, 3) by clipping ears.

    Also returns the number of corners that were cut without a test after the step limit.
    """

def weld_corners(
    corners: NDArray[np.int32], point_count: int, values: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Merges corners of a point that have equal values; returns corner indices and values."""
