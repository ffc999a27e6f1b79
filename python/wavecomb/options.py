# SPDX-License-Identifier: Apache-2.0
"""Settings of a render, read from the core's table (core/settings_table.h).

The settings determine the keyword arguments of ``wavecomb.render``, the options of commands, the
window's fields and the keys of benchmark suites.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from wavecomb.core_table import rows_by_name


@dataclass(frozen=True)
class Setting:
    """A setting of a render, which has a single value.

    Attributes:
        name: Attribute of ``wavecomb.Settings``, which is also a keyword argument.
        label: Label of the setting in the window.
        help: Description of the setting in one sentence.
        kind: "integer", "number", "flag", "choice" or "text".
        default: Default value; None if the default depends on other settings.
        least: Smallest valid number; None means that there is no lower limit.
        most: Largest valid number; None means that there is no upper limit.
        zero: Meaning of the value 0, if this value has a special meaning.
        steps: Valid numbers in addition to 0; empty means that all numbers in the range are valid.
        choices: For a setting of kind "choice", the effect of each value.
        group: "picture" (content of the image), "work" (amount of computation) or "order" (order of
            computation).
        changes_picture: Whether the image depends on the setting.
        changes_bits: Whether the setting affects the bits of the beauty image at equal sample
            counts. With cost-aware roulette, the bits of the image also depend on measured shading
            costs.
        changes_expectation: Whether the expectation of the image depends on the setting.
    """

    name: str
    label: str
    help: str
    kind: str
    default: Any
    least: float | None
    most: float | None
    zero: str
    steps: tuple[float, ...]
    choices: Mapping[str, str]
    group: str
    changes_picture: bool
    changes_bits: bool
    changes_expectation: bool

    @property
    def option(self) -> str:
        """Option of commands.

        >>> settings()["wave_size"].option
        '--wave-size'
        """
        return "--" + self.name.replace("_", "-")

    @property
    def annotation(self) -> str:
        """Python type annotation of the setting in the stub _core.pyi.

        >>> settings()["light_weights"].annotation
        'Literal["calibrated", "power"]'
        """
        if self.kind == "choice" and self.name != "policy":
            return "Literal[" + ", ".join(f'"{name}"' for name in self.choices) + "]"
        kinds = {"integer": "int", "number": "float", "flag": "bool", "choice": "str"}
        return kinds.get(self.kind, "str")


@cache
def settings() -> Mapping[str, Setting]:
    """Returns all settings by name, in the order of the core's table.

    >>> settings()["wave_size"].zero
    'automatic'
    """
    from wavecomb import _core

    return rows_by_name(Setting, _core.setting_table())


def names(group: str, *, without: Iterable[str] = ()) -> tuple[str, ...]:
    """Returns the settings of a group, in the order of the core's table.

    >>> names("work")[:2]
    ('roulette', 'roulette_depth')
    """
    left_out = set(without)
    return tuple(
        name for name, row in settings().items() if row.group == group and name not in left_out
    )


@cache
def expectation() -> tuple[str, ...]:
    """Returns the settings on which the expectation of the image depends.

    >>> "max_depth" in expectation(), "seed" in expectation()
    (True, False)
    """
    return tuple(name for name, row in settings().items() if row.changes_expectation)


def default_text(setting: Setting) -> str:
    """Returns the default value of a setting as text.

    >>> default_text(settings()["threads"]), default_text(settings()["spp"])
    ('all', '64')
    """
    if setting.default is None:
        return "depends on other settings"
    if setting.zero and not setting.default:
        return setting.zero
    if isinstance(setting.default, float):
        return f"{setting.default:g}"
    return str(setting.default)
