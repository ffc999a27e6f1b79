# SPDX-License-Identifier: Apache-2.0
"""User-written scheduling policies, loaded from a Python file. Independent of Qt."""

from __future__ import annotations

import inspect
import os
import sys
import traceback
import types
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import check_regular
from wavecomb.scheduling import SchedulingPolicy, check_policy


def load_policies(path: str | os.PathLike[str]) -> list[SchedulingPolicy]:
    """Creates an object of each ``SchedulingPolicy`` class that a file defines, in file order.

    Executes the file on each call, so that changes of the file take effect.

    Raises:
        WavecombError: The file cannot be read or executed, or has no valid policy. The message is
            one line that names the file and, if known, the line number.
    """
    path = Path(path)
    module = _run(path)
    classes = [
        value
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, SchedulingPolicy)
        and value.__module__ == module.__name__
    ]
    if not classes:
        raise WavecombError(
            f"{path}: defines no policy; write class Mine(wavecomb.SchedulingPolicy) with a method "
            "order(self, queue, costs, keys)"
        )
    return [_made(kind, path) for kind in dict.fromkeys(classes)]


class OwnPolicy(SchedulingPolicy):
    """A loaded policy for a live render, which converts exceptions to one-line errors.

    Attributes:
        path: File of the policy.
        policy: The loaded policy.
    """

    def __init__(self, policy: SchedulingPolicy, path: str | os.PathLike[str], name: str) -> None:
        self.policy = policy
        self.path = os.fspath(path)
        self.name = name
        self.columns = policy.columns  # type: ignore[misc]

    def order(self, queue: Any, costs: Any, keys: Any) -> bool | None:
        """Calls ``order`` of the loaded policy and adds advice to its exceptions."""
        try:
            return self.policy.order(queue, costs, keys)
        except Exception as error:
            message = describe_failure(error, self.path)
            raise WavecombError(f"{message}; fix it and load it again") from error


def describe_failure(error: BaseException, path: str | os.PathLike[str]) -> str:
    """Describes an error of a policy in one line.

    Includes the line number if the error occurred in the policy's file.
    """
    name = os.fspath(path)
    if isinstance(error, SyntaxError):
        line = error.lineno
    else:
        frames = traceback.extract_tb(error.__traceback__)
        line = next((one.lineno for one in reversed(frames) if one.filename == name), None)
    text = " ".join(str(error.msg if isinstance(error, SyntaxError) else error).split())
    what = f"{type(error).__name__}: {text}" if text else type(error).__name__
    return f"{name}{f', line {line}' if line else ''}: {what}"


def first_line(policy: SchedulingPolicy) -> str:
    """Returns the first line of a policy's docstring, or the policy's name."""
    text = vars(type(policy)).get("__doc__") or ""
    return text.strip().splitlines()[0] if text.strip() else policy.name


def _run(path: Path) -> types.ModuleType:
    try:
        check_regular(path)
        source = path.read_text(encoding="utf-8")
    except OSError as error:
        why = str(error) if error.strerror is None else f"{path}: {error.strerror}"
        raise WavecombError(why) from None
    except UnicodeDecodeError:
        raise WavecombError(f"{path}: is not UTF-8 text; choose a Python file") from None
    module = types.ModuleType(f"wavecomb_policy_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses and pickle look up modules in sys.modules.
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        sys.modules.pop(module.__name__, None)
        raise WavecombError(describe_failure(error, path)) from error
    return module


def _made(kind: Any, path: Path) -> SchedulingPolicy:
    try:
        policy = kind()
    except Exception as error:
        raise WavecombError(describe_failure(error, path)) from error
    if kind.order is SchedulingPolicy.order:
        raise WavecombError(f"{path}: {kind.__name__} has no method order(queue, costs, keys)")
    try:
        check_policy(policy)
    except WavecombError as error:
        raise WavecombError(f"{path}: {error}") from None
    return policy
