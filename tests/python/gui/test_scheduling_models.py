# SPDX-License-Identifier: Apache-2.0
"""Tests the models of the scheduling panel without Qt: image comparison, policies, choices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wavecomb.errors import WavecombError
from wavecomb.gui.compare.same_picture import PictureBook, even_samples, fingerprint, picture_key
from wavecomb.gui.scheduling.policy_file import describe_failure, first_line, load_policies

SETUP = {"width": 4, "height": 3, "seed": 0, "roulette": "throughput", "costs": "auto"}


def test_fingerprint_is_of_bits() -> None:
    picture = np.linspace(0, 1, 36, dtype=np.float32).reshape(3, 4, 3)
    again = picture[::-1].copy()[::-1]
    assert fingerprint(picture) == fingerprint(again)
    again = picture.copy()
    again[1, 2, 0] = np.nextafter(again[1, 2, 0], np.float32(2))
    assert fingerprint(picture) != fingerprint(again)


def test_even_samples() -> None:
    samples = np.full((3, 4), 8, np.uint32)
    assert even_samples(samples) == 8
    samples[2, 3] = 9
    assert even_samples(samples) == 0 and even_samples(None) == 0


def test_what_decides_over_bits() -> None:
    key = picture_key(SETUP, 1)
    assert key is not None
    for free in ({"policy": "none"}, {"lanes": 1}, {"threads": 2}, {"costs": "model"}):
        assert picture_key({**SETUP, **free}, 1) == key
    for bound in ({"seed": 1}, {"roulette": "off"}, {"width": 5}, {"noise": 0.1}):
        assert picture_key({**SETUP, **bound}, 1) != key
    assert picture_key(SETUP, 2) != key
    aware = {**SETUP, "roulette": "cost-aware"}
    assert picture_key(aware, 1) != picture_key({**aware, "costs": "model"}, 1)
    assert picture_key({**aware, "costs": "measured"}, 1) is None
    assert picture_key({**SETUP, "time_limit": 1.0}, 1) is None


def test_book() -> None:
    book = PictureBook()
    key = picture_key(SETUP, 1)
    assert book.add(key, 8, "a", {"policy": "program"}).kind == "first"
    assert book.add(key, 16, "b", {"policy": "program"}).kind == "first", "more samples"
    same = book.add(key, 8, "a", {"policy": "none"})
    assert same.kind == "same" and "none" in same.text and book.checked == 1
    other = book.add(key, 8, "c", {"policy": "material"})
    assert other.kind == "different" and "material" in other.text and book.checked == 0
    assert book.add(None, 8, "a", {}).kind == "none"
    book.clear()
    assert book.add(key, 8, "c", {"policy": "none"}).kind == "first"
    for i in range(100):
        book.add(key, i, "x", {})
    assert len(book._pictures) <= 32


GOOD = '''
import wavecomb

class CheapestFirst(wavecomb.SchedulingPolicy):
    """The cheapest material first."""

    name = "cheapest-first"

    def order(self, queue, costs, keys):
        keys[:] = 1000 * costs["material_ns"][queue["material"]]

class Reversed(wavecomb.SchedulingPolicy):
    name = "reversed"

    def order(self, queue, costs, keys):
        keys[:] = 1000 - queue["material"]
'''


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_policies_of_a_file(tmp_path: Path) -> None:
    file = write(tmp_path / "mine.py", GOOD)
    policies = load_policies(file)
    assert [one.name for one in policies] == ["cheapest-first", "reversed"]
    assert first_line(policies[0]) == "The cheapest material first."
    assert first_line(policies[1]) == "reversed"
    write(file, GOOD.replace("cheapest-first", "edited"))
    assert load_policies(file)[0].name == "edited", "an edited file is read anew"


BAD = {
    "x = 1": "defines no policy",
    "from wavecomb import SchedulingPolicy": "defines no policy",
    "class A(": "line 1: SyntaxError",
    "\nraise RuntimeError('no\\nluck')": "line 2: RuntimeError: no luck",
    "import sys\nsys.exit(3)": "SystemExit",
    "import wavecomb\nclass A(wavecomb.SchedulingPolicy):\n    pass": "A has no method order",
    "import wavecomb\nclass A(wavecomb.SchedulingPolicy):\n    columns = ('colour',)\n"
    "    def order(self, queue, costs, keys):\n        pass": "'colour' is not known",
    "import wavecomb\nclass A(wavecomb.SchedulingPolicy):\n    def __init__(self, n):\n"
    "        pass\n    def order(self, queue, costs, keys):\n        pass": "TypeError",
}


@pytest.mark.parametrize("text", BAD)
def test_bad_policy_files(text: str, tmp_path: Path) -> None:
    file = write(tmp_path / "bad.py", text)
    with pytest.raises(WavecombError) as caught:
        load_policies(file)
    message = str(caught.value)
    assert message.startswith(str(file)) and BAD[text] in message and "\n" not in message


def test_no_policy_file(tmp_path: Path) -> None:
    with pytest.raises(WavecombError, match="No such file"):
        load_policies(tmp_path / "missing.py")
    (tmp_path / "binary.py").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(WavecombError, match="UTF-8"):
        load_policies(tmp_path / "binary.py")


def test_a_failure_in_order_names_the_line(tmp_path: Path) -> None:
    file = write(tmp_path / "mine.py", GOOD)
    (policy, _) = load_policies(file)
    with pytest.raises(KeyError) as caught:
        policy.order({}, {"material_ns": np.zeros(1)}, np.zeros(1, np.uint64))
    assert describe_failure(caught.value, file) == f"{file}, line 10: KeyError: 'material'"


def test_every_policy_and_setting_is_offered() -> None:
    core: Any = pytest.importorskip("wavecomb._core")
    from wavecomb.gui.scheduling import choices
    from wavecomb.gui.setup import Setup

    assert list(choices.choice("policy").values) == core.policies()
    assert list(choices.lane_choices()) == [0, *core.lane_widths()]
    for one in (*choices.fields_of("order", ("progressive",)), *choices.fields_of("work")):
        if isinstance(one, choices.Number):
            assert one.least <= getattr(Setup(), one.field) <= one.most or one.field in (
                "adaptive", "noise",
            )  # fmt: skip
            continue
        for value, tip in one.values.items():
            Setup().changed(**{one.field: value})
            assert tip.endswith(".") or ". " in tip
        assert getattr(Setup(), one.field) in one.values, "the default is among them"
    for _, preset in choices.presets().values():
        Setup().changed(**preset)
        assert not preset.keys() & set(choices.WORK_FIELDS), "presets change no picture"
