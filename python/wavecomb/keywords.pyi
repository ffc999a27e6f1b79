# SPDX-License-Identifier: Apache-2.0
"""Types of the keywords of ``load`` and ``render``, written by tools/update_stub.

Only type checkers and editors read this stub.
"""

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

class StageKeywords(TypedDict, total=False):
    """Fields of ``LoadOptions`` for any function."""

    camera: str | None
    frame: float | None
    purposes: Sequence[str] | None
    variants: Mapping[str, Any] | None
    lights: str
    shutter: tuple[float, float] | None
    motion_blur: bool | None
    motion_steps: int | None
    render_settings: str | None
    product: str | None
    projection: str | None
    exposure: bool
    depth_of_field: bool | None
    lens_settings: Mapping[str, Any] | None
    st_map: str | os.PathLike[str] | None
    mask: Sequence[str]
    payloads: Sequence[str]
    holdouts: Sequence[str]
    catchers: Sequence[str]
    catch: str
    session_layer: str | os.PathLike[str] | None
    texture_limit: float | None
    working_space: str
    subdivision: str | int
    strand_pixels: float

class LoadKeywords(StageKeywords, total=False):
    """Keywords of ``load``."""

    size: tuple[int, int]
    threads: int

class SettingKeywords(TypedDict, total=False):
    """Fields of ``Settings``."""

    max_depth: int
    seed: int
    sampler: Literal["sobol", "independent"]
    filter: Literal["box", "gaussian", "blackman-harris"]
    filter_width: float | None
    clamp_indirect: float
    fresnel: Literal["exact", "schlick"]
    texture_filter: Literal["auto", "whole"]
    cosine_sampling: bool
    alpha: bool
    error: bool
    overscan: int
    deep_samples: int
    deep_tolerance: float
    crop: bool
    roulette: Literal["auto", "off", "throughput", "cost-aware", "efficient"]
    shadow_roulette: Literal["off", "on"]
    quality: Literal["auto", "plain"]
    transport: Literal["path", "light", "auto", "bdpt"]
    light_aim: Literal["off", "on"]
    light_splats: Literal["auto", "filtered", "pixel"]
    merge_radius: float
    auto_merge: Literal["off", "on"]
    firefly: Literal["keep", "reweight"]
    roulette_depth: int
    light_selection: Literal["auto", "tree", "power"]
    light_weights: Literal["calibrated", "power"]
    equiangular: Literal["off", "on"]
    guiding: Literal["auto", "on", "off"]
    learn_memory: int
    adaptive: float
    noise: float
    min_spp: int
    allocate: Literal["even", "error", "efficiency"]
    time_limit: float
    integrator: Literal["wavefront", "reference"]
    ray_order: Literal["slot", "morton", "morton-octant", "direction", "auto"]
    shadow_order: Literal["slot", "morton", "morton-octant", "direction", "auto"]
    lanes: int
    wave_size: int
    materialize: Literal["auto", "on", "off"]
    traversal: Literal["packets", "single"]
    threads: int
    cost_weight: float
    progressive: bool
    region: tuple[int, int, int, int] | None

class RenderKeywords(StageKeywords, SettingKeywords, total=False):
    """Keywords of ``render``."""
