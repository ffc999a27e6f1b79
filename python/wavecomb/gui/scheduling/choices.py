# SPDX-License-Identifier: Apache-2.0
"""Setting values, descriptions and presets that the scheduling panel offers. Independent of Qt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from wavecomb.gui.scheduling.run_log import FIELDS
from wavecomb.gui.setup import Setup
from wavecomb.options import names, settings


@dataclass(frozen=True)
class Choice:
    """A setting with a fixed set of values, shown as a drop-down field."""

    field: str
    label: str
    tip: str
    values: Mapping[Any, str]
    """Description of each value of the setting."""


@dataclass(frozen=True)
class Number:
    """A numeric setting. For the value 0, the field shows the text in ``zero``."""

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
    """Returns the SIMD widths that this build supports, with descriptions."""
    from wavecomb import _core

    widths = _core.lane_widths()
    return {
        0: f"The widest of this build and machine: {max(widths)}.",
        **{
            width: "One record at a time." if width == 1 else f"{width} records at a time."
            for width in widths
        },
    }


WAVE_SIZES: dict[Any, str] = {
    0: "Chosen by the caches of this machine.",
    **{1 << n: f"{1 << n} paths per wave." for n in range(8, 21)},
}


def choice(name: str) -> Choice:
    """Returns the drop-down field of a setting in the core's table of settings."""
    row = settings()[name]
    values: dict[Any, str] = dict(row.choices)
    if name == "wave_size":
        values = WAVE_SIZES
    elif name == "lanes":
        values = lane_choices()
    elif row.default in values:
        values[row.default] += " The default."
    return Choice(name, row.label, row.help, values)


_SHOWN: dict[str, dict[str, Any]] = {
    "cost_weight": {"decimals": 2, "step": 0.05},
    "adaptive": {"least": 0.0001, "most": 10.0, "zero": "", "decimals": 4, "step": 0.005},
    "noise": {"least": 0.0001, "zero": "", "decimals": 4, "step": 0.005},
    "time_limit": {"most": 86400, "decimals": 1, "suffix": " s"},
    "threads": {"most": 256},
    "roulette_depth": {"most": 64},
    "min_spp": {"most": 65536},
}
"""Display options of fields that replace those in the core's table of settings."""


def number(name: str) -> Number:
    """Returns the number field of a setting in the core's table of settings."""
    row = settings()[name]
    values: dict[str, Any] = {"least": row.least or 0, "most": row.most, "zero": row.zero}
    if row.kind == "number":
        values |= {"decimals": 3, "step": 0.1}
    if row.zero:
        values["least"] = 0
    return Number(name, row.label, row.help, **{**values, **_SHOWN.get(name, {})})


def fields_of(group: str, without: tuple[str, ...] = ()) -> tuple[Choice | Number, ...]:
    """Returns the fields of a group of settings, in the order of the core's table."""
    rows = (settings()[name] for name in names(group, without=without))
    is_choice = lambda row: row.kind == "choice" or row.name in ("lanes", "wave_size")  # noqa: E731
    return tuple(choice(row.name) if is_choice(row) else number(row.name) for row in rows)


ADAPTIVE_MODES = {
    "off": "Every pixel gets the same number of samples.",
    "pixel": "A pixel stops when its error is small enough.",
    "noise": "The render ends when the image's mean error is small enough; noisy pixels get more "
    "samples.",
}
ORDER_FIELDS = names("order", without=("progressive",))
WORK_FIELDS = names("work")


def scheduling_of(setup: Setup) -> dict[str, Any]:
    """Returns the settings that distinguish run series, including the names of loaded policies."""
    values = {name: getattr(setup, name) for name in FIELDS}
    if setup.own_policy is not None:
        values["policy"] = setup.own_policy.name
    if setup.profile is not None:
        values["costs"] = "profile"
    return values


def promise(setup: Setup) -> str:
    """Returns a text that says whether the settings for the order of work affect the image.

    The order of work does not change the image, except with a time limit or cost-aware roulette.
    """
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
    return "These settings do not change the picture."


def recipe_of(setup: Setup) -> dict[str, Any]:
    """Returns the fields of a setup that must be restored to repeat a run."""
    return {name: getattr(setup, name) for name in (*FIELDS, "own_policy", "profile")}


def defaults(names: tuple[str, ...]) -> dict[str, Any]:
    """Returns the default values of settings."""
    known = {one.name: one.default for one in fields(Setup)}
    return {name: known[name] for name in names}


def presets() -> dict[str, tuple[str, dict[str, Any]]]:
    """Returns the presets by name. Each preset is a pair of a description and settings.

    All presets except the first set only the order of work.
    """
    order = defaults((*ORDER_FIELDS, "own_policy", "profile"))
    return {
        "Default": ("Default settings.", order),
        "Reference: none, 1 lane": (
            "Arrival order, one lane, rays as generated: the baseline for orders and lanes.",
            order | {"policy": "none", "lanes": 1, "ray_order": "slot", "shadow_order": "slot"},
        ),
        "Lanes only: none, widest": (
            "Arrival order in full lanes: the gain of lanes without an order.",
            order | {"policy": "none", "ray_order": "slot", "shadow_order": "slot"},
        ),
        "Placebo: random-runs": (
            "Runs of one material in random order: the baseline for the order of runs.",
            order | {"policy": "random-runs"},
        ),
        "Oracle: reference integrator": (
            "One path at a time, depth first: the reference for every picture.",
            order | {"integrator": "reference", "traversal": "single"},
        ),
    }
