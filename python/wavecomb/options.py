# SPDX-License-Identifier: Apache-2.0
"""What a render can be told: the rows of the core's table of settings (core/settings_table.h).

Keywords of ``wavecomb.render``, options of the commands, the window's fields and a suite's keys
follow from them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from wavecomb.core_table import rows_by_name


@dataclass(frozen=True)
class Setting:
    """A setting that is one value.

    Attributes:
        name: Of the attribute of ``wavecomb.Settings`` and the keyword.
        label: In a form.
        help: What it is, a sentence.
        kind: "integer", "number", "flag", "choice" or "text".
        default: None where it follows from other settings.
        least: Smallest number; None: any.
        most: Largest number; None: any.
        zero: What 0 stands for, where it stands for something.
        steps: The numbers that there are, beside 0; empty: all.
        choices: Value -> what it does; of a choice.
        group: "picture": what the picture is; "work": how much is done for it; "order": what
            computes it, and in which order.
        changes_picture: Whether the picture depends on it.
        changes_bits: Whether the bits of the beauty image depend on it, where each pixel has as
            many samples. Costs may, with cost-aware roulette.
        changes_expectation: Whether the picture that more and more samples tend to depends on it.
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
        """The option of a command.

        >>> settings()["wave_size"].option
        '--wave-size'
        """
        return "--" + self.name.replace("_", "-")

    @property
    def annotation(self) -> str:
        """Its type in a stub.

        >>> settings()["light_weights"].annotation
        'Literal["calibrated", "power"]'
        """
        if self.kind == "choice" and self.name != "policy":
            return "Literal[" + ", ".join(f'"{name}"' for name in self.choices) + "]"
        kinds = {"integer": "int", "number": "float", "flag": "bool", "choice": "str"}
        return kinds.get(self.kind, "str")


@cache
def settings() -> Mapping[str, Setting]:
    """Every setting by name, in the table's order.

    >>> settings()["wave_size"].zero
    'automatic'
    """
    from wavecomb import _core

    return rows_by_name(Setting, _core.setting_table())


def names(group: str, *, without: Iterable[str] = ()) -> tuple[str, ...]:
    """The settings of a group, in the table's order.

    >>> names("work")[:2]
    ('roulette', 'roulette_depth')
    """
    left_out = set(without)
    return tuple(
        name for name, row in settings().items() if row.group == group and name not in left_out
    )


@cache
def expectation() -> tuple[str, ...]:
    """The settings that the picture depends on which more and more samples tend to.

    >>> "max_depth" in expectation(), "seed" in expectation()
    (True, False)
    """
    return tuple(name for name, row in settings().items() if row.changes_expectation)


def default_text(setting: Setting) -> str:
    """The default for people.

    >>> default_text(settings()["threads"]), default_text(settings()["spp"])
    ('all', '64')
    """
    if setting.default is None:
        return "its own"
    if setting.zero and not setting.default:
        return setting.zero
    if isinstance(setting.default, float):
        return f"{setting.default:g}"
    return str(setting.default)
