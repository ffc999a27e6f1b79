# SPDX-License-Identifier: Apache-2.0
"""What the scheduling panel offers: choices, what each does, presets; no Qt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from wavecomb.gui.scheduling.run_log import FIELDS
from wavecomb.gui.setup import Setup
from wavecomb.scheduling import POLICIES, RAY_ORDERS

POLICY_HELP = {
    "none": "Arrival order; nothing is paid for it.",
    "program": "By program, the kind of material: what lanes need and no more. The default.",
    "material": "By program, then by estimated cost of the material, then by material.",
    "texture": "By program, then by the size of the material's largest texture.",
    "texture-locality": "By program, material and place in its texture (tile, mip level, uv), "
    "as MoonRay's shade queues.",
    "cost-benefit": "By program, then by throughput over cost of a material, highest first, "
    "then by place in the scene.",
    "random-runs": "The placebo: the runs of 'material' in an order that means nothing.",
    "adaptive": "Chooses among none, program, material, texture and texture-locality, queue by "
    "queue, by the times that it learns.",
}
RAY_ORDER_HELP = {
    "slot": "As generated: survivors keep their places.",
    "morton": "By place of the origin.",
    "morton-octant": "By octant of the direction, then by place of the origin.",
    "direction": "By octant and long axes of the direction.",
    "auto": "The quickest of the four, learned for each depth. The default.",
}


@dataclass(frozen=True)
class Choice:
    """One setting that has names to choose from."""

    field: str
    label: str
    tip: str
    values: Mapping[Any, str]
    """Value -> what it does."""


@dataclass(frozen=True)
class Number:
    """One setting that is a number; 0 means ``zero``."""

    field: str
    label: str
    tip: str
    most: float
    least: float = 0
    zero: str = ""
    decimals: int = 0
    step: float = 1
    suffix: str = ""


def lane_choices() -> dict[Any, str]:
    """Lane widths of this build."""
    from wavecomb import _core

    widths = _core.lane_widths()
    return {
        0: f"The widest of this build and machine: {max(widths)}.",
        **{
            width: "One record at a time." if width == 1 else f"{width} records at a time."
            for width in widths
        },
    }


def policy_choices() -> dict[str, str]:
    """Every policy of the core, with what it does."""
    from wavecomb import _core

    return {name: POLICY_HELP.get(name, "A policy of this build.") for name in _core.policies()}


WAVE_SIZES: dict[Any, str] = {
    0: "As wide as the caches of this machine ask for.",
    **{1 << n: f"{1 << n} paths a wave." for n in range(8, 21)},
}

ORDER_CHOICES = (
    Choice("policy", "Policy", "The order in which hits are shaded.",
           {name: POLICY_HELP[name] for name in POLICIES}),
    Choice("ray_order", "Ray order", "The order in which bounce rays are traced.",
           {name: RAY_ORDER_HELP[name] for name in RAY_ORDERS}),
    Choice("shadow_order", "Shadow order", "The order in which shadow rays are traced.",
           {name: RAY_ORDER_HELP[name] for name in RAY_ORDERS}),
    Choice("lanes", "Lanes", "How many records are shaded at once.", {}),
    Choice("wave_size", "Wave size", "Paths that are followed together by one thread.",
           WAVE_SIZES),
    Choice("materialize", "Materialize", "Whether records are moved into their order.",
           {"auto": "Off, since that measures faster. The default.",
            "on": "Records are moved into their order before they are shaded.",
            "off": "Shading gathers its inputs through indices."}),
    Choice("traversal", "Traversal", "How rays are handed to Embree.",
           {"packets": "In packets. The default.", "single": "One by one."}),
    Choice("integrator", "Integrator", "How paths are followed.",
           {"wavefront": "Waves of paths, stage by stage. The default.",
            "reference": "One path at a time, depth first: the oracle. Slow; has no queues, so "
            "that nothing above plays a part."}),
    Choice("costs", "Costs", "Where the estimated costs of materials come from.",
           {"auto": "Calibrated, then measured; roulette uses the model. The default.",
            "measured": "Calibrated, then measured, for roulette too: with cost-aware roulette "
            "the picture then varies within its noise.",
            "model": "Fixed numbers by program and texture reads: reproducible."}),
)  # fmt: skip
"""The order of work. With the policy first; lanes and policies are filled in by the build."""

THREADS = Number("threads", "Threads", "Threads that render.", 256, zero="all")
COST_WEIGHT = Number(
    "cost_weight", "Cost weight", "Weight of a pass in the moving average of costs.",
    1.0, decimals=2, step=0.05,
)  # fmt: skip

ROULETTE = Choice(
    "roulette", "Roulette", "How paths end early. Each is unbiased, but another estimate.",
    {"throughput": "By the light that the path still carries. The default.",
     "cost-aware": "By the light that it carries, over the root of what shading costs.",
     "off": "Paths end at the greatest depth only."},
)  # fmt: skip
ROULETTE_DEPTH = Number(
    "roulette_depth", "From depth", "The first vertex at which a path may end early.", 64
)
LIGHT_SELECTION = Choice(
    "light_selection", "Lights", "How a light is chosen to sample.",
    {"auto": "By tree where there are several to choose among, else by power. The default.",
     "tree": "For the place that it lights, by a tree of lights.",
     "power": "By its power, wherever it is."},
)  # fmt: skip
LIGHT_WEIGHTS = Choice(
    "light_weights", "Light shares", "How often each light is chosen.",
    {"calibrated": "By what it brings to the picture, as some paths before the first pass find "
     "out. The default.",
     "power": "By its power, wherever it is."},
)  # fmt: skip
ADAPTIVE_MODES = {
    "off": "Every pixel gets as many samples.",
    "pixel": "Pixels stop when their own error is small enough.",
    "noise": "The render ends when the picture's mean error is small enough; samples go where "
    "the noise is.",
}
PIXEL_ERROR = Number(
    "adaptive", "Pixel error", "Error that a pixel may have, as a share of its brightness.",
    10.0, least=0.0001, decimals=4, step=0.005,
)  # fmt: skip
NOISE = Number(
    "noise", "Noise", "Mean relative error that the picture may have.",
    10.0, least=0.0001, decimals=4, step=0.005,
)  # fmt: skip
MIN_SPP = Number(
    "min_spp", "Min samples", "Samples of each pixel before the first look at errors.",
    65536, least=1,
)  # fmt: skip
SPP = Number("spp", "Samples", "Samples of each pixel; with adaptive sampling, the most.",
             1 << 24, least=1)  # fmt: skip
TIME_LIMIT = Number(
    "time_limit", "Time limit", "Seconds of rendering.", 86400, zero="none", decimals=1, suffix=" s"
)

ORDER_FIELDS = (*(choice.field for choice in ORDER_CHOICES), THREADS.field, COST_WEIGHT.field)
WORK_FIELDS = (
    "roulette", "roulette_depth", "light_selection", "light_weights", "adaptive", "noise",
    "min_spp", "spp", "time_limit",
)  # fmt: skip


def scheduling_of(setup: Setup) -> dict[str, Any]:
    """The settings by which series are told apart, with names for what was loaded."""
    values = {name: getattr(setup, name) for name in FIELDS}
    if setup.own_policy is not None:
        values["policy"] = setup.own_policy.name
    if setup.profile is not None:
        values["costs"] = "profile"
    return values


def promise(setup: Setup) -> str:
    """What the settings of order do to the picture: nothing, with two exceptions."""
    if setup.time_limit:
        return (
            "Nothing in this group changes a bit of a sample, but the time limit ends the render "
            "by the clock: how many there are differs."
        )
    if setup.roulette == "cost-aware":
        return (
            "Nothing in this group but Costs changes a bit of the picture: cost-aware roulette "
            "goes by them."
        )
    return "Nothing in this group changes a bit of the picture."


def recipe_of(setup: Setup) -> dict[str, Any]:
    """What to set to have these settings again."""
    return {name: getattr(setup, name) for name in (*FIELDS, "own_policy", "profile")}


def defaults(names: tuple[str, ...]) -> dict[str, Any]:
    """The default values of settings."""
    known = {one.name: one.default for one in fields(Setup)}
    return {name: known[name] for name in names}


def presets() -> dict[str, tuple[str, dict[str, Any]]]:
    """Name -> (what it is for, settings); all but the first are of order only."""
    order = defaults((*ORDER_FIELDS, "own_policy", "profile"))
    return {
        "Default": ("What a render does unless told otherwise.", order),
        "Reference: none, 1 lane": (
            "Arrival order, one lane, rays as generated: what orders and lanes are measured "
            "against.",
            order | {"policy": "none", "lanes": 1, "ray_order": "slot", "shadow_order": "slot"},
        ),
        "Lanes only: none, widest": (
            "Arrival order in full lanes: what lanes give without an order.",
            order | {"policy": "none", "ray_order": "slot", "shadow_order": "slot"},
        ),
        "Placebo: random-runs": (
            "Runs of one material in an order that means nothing: what the order of runs has to "
            "beat.",
            order | {"policy": "random-runs"},
        ),
        "Oracle: reference integrator": (
            "One path at a time, depth first: what every picture must equal.",
            order | {"integrator": "reference", "traversal": "single"},
        ),
    }
