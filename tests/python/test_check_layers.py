# SPDX-License-Identifier: Apache-2.0
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "check_layers"
HEAD = "// SPDX-License-Identifier: Apache-2.0\n"


def run(root: pathlib.Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, str(TOOL), str(root)], capture_output=True, text=True, check=False
    )


def tree(root: pathlib.Path, files: dict[str, str]) -> pathlib.Path:
    for name, text in files.items():
        path = root / "src" / "wavecomb" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(HEAD + text)
    return root


@pytest.mark.slow
def test_this_tree_is_clean():
    result = run(ROOT)
    assert result.returncode == 0, result.stderr


def test_downward_includes_pass(tmp_path):
    files = {
        "core/lanes/types.h": "#include <drjit/packet.h>\n",
        "texture/tile.h": '#include "wavecomb/core/lanes/types.h"\n',
        "scene/scene.h": '#include "wavecomb/texture/tile.h"\n#include <tbb/parallel_for.h>\n',
        "accel/embree.cpp": '#include <embree4/rtcore.h>\n#include "wavecomb/scene/scene.h"\n',
        "schedule/policies/none.h": '#include "wavecomb/schedule/policy.h"\n',
        "schedule/policy.h": "#include <span>\n",
        "wave/wave.cpp": '#include "wavecomb/schedule/policy.h"\n',
        "geometry/hit/uv.h": '#include "wavecomb/scene/scene.h"\n',
        "light/kinds/triangle.h": '#include "wavecomb/geometry/hit/uv.h"\n',
        "graph/run.h": '#include "wavecomb/texture/tile.h"\n',
        "graph/parameters/value.h": '#include "wavecomb/scene/scene.h"\n'
        '#include "wavecomb/graph/run.h"\n',
        "material/inputs/values.h": '#include "wavecomb/graph/parameters/value.h"\n',
        "geometry/curve/checks.h": '#include "wavecomb/scene/scene.h"\n',
        "scene/builder.cpp": '#include "wavecomb/geometry/curve/checks.h"\n',
        "light_paths/join.h": '#include "wavecomb/path/vertex.h"\n',
        "path/vertex.h": '#include "wavecomb/path/features.h"\n',
        "wave/joint_transport.h": '#include "wavecomb/light_paths/join.h"\n',
        "light_paths/stages/connect.h": '#include "wavecomb/wave/wave.h"\n',
        "render/renderer.cpp": '#include <oneapi/tbb.h>\n#include "wavecomb/wave/wave.h"\n',
        "wavecomb.h": '#include "wavecomb/render/renderer.h"\n',
    }
    result = run(tree(tmp_path, files))
    assert result.returncode == 0, result.stderr
    assert "20 files, 0 violations" in result.stdout


@pytest.mark.parametrize(
    ("name", "line", "message"),
    [
        ("core/rng.h", '#include "wavecomb/scene/scene.h"', "above it"),
        ("scene/scene.h", '#include "wavecomb/film/film.h"', "above it"),
        ("wave/wave.h", '#include "wavecomb/render/renderer.h"', "above it"),
        ("wave/wave.h", '#include "wavecomb/reference/path_tracer.h"', "above it"),
        ("path/vertex.h", '#include "wavecomb/wave/wave.h"', "above it"),
        ("light_paths/join.h", '#include "wavecomb/light_paths/stages/connect.h"', "above it"),
        ("core/rng.h", '#include "wavecomb/wavecomb.h"', "above it"),
        ("texture/tile.h", '#include "wavecomb/scene/scene.h"', "above it"),
        ("geometry/hit/uv.h", '#include "wavecomb/light/kinds/triangle.h"', "above it"),
        ("graph/run.h", '#include "wavecomb/graph/parameters/value.h"', "above it"),
        ("texture/tile.h", '#include "wavecomb/graph/parameters/value.h"', "above it"),
        ("light/description/light.h", '#include "wavecomb/light/kinds/kinds.h"', "above it"),
        ("scene/scene.h", '#include "wavecomb/geometry/hit/surface.h"', "above it"),
        ("geometry/hit/surface.h", '#include "wavecomb/material/inputs/inputs.h"', "above it"),
        ("geometry/hit/surface.h", '#include "wavecomb/material/bsdf.h"', "above it"),
        ("material/table.h", '#include "wavecomb/schedule/policy.h"', "beside it"),
        ("light/sampler.h", '#include  "wavecomb/accel/accelerator.h"', "beside it"),
        ("geometry/tessellation/ears.h", '#include "wavecomb/film/film.h"', "beside it"),
        ("schedule/queue.h", '#include "wavecomb/scene/scene.h"', "only core"),
        ("schedule/queue.h", '#include "wavecomb/texture/tile.h"', "only core"),
        ("wave/wave.cpp", "#include <embree4/rtcore.h>", "Embree"),
        ("core/warp.h", "# include <drjit/math.h>", "Dr.Jit"),
        ("schedule/sort.cpp", "#include <tbb/parallel_sort.h>", "oneTBB"),
        ("wave/wave.cpp", '#include "oneapi/tbb/task_arena.h"', "oneTBB"),
        ("render/renderer.h", "#include <nanobind/nanobind.h>", "Python"),
        ("scene/scene.h", "#include <pxr/usd/usd/stage.h>", "USD"),
        ("core/rng.h", '#include "hash.h"', "from the root"),
        ("core/rng.h", '#include "../scene/scene.h"', "from the root"),
        ("core/rng.h", "#include <wavecomb/core/hash.h>", "write #include"),
        ("gpu/kernel.h", "#include <span>", "no known layer"),
        ("geometry/point.h", "#include <span>", "no known layer"),
        ("core/rng.h", '#include "wavecomb/gpu/kernel.h"', "no known layer"),
        ("path/vertex.h", '#include "wavecomb/light_paths/join.h"', "above it"),
        ("wave/wave.h", '#include "wavecomb/light_paths/join.h"', "only the files that register"),
        ("render/renderer.h", '#include "wavecomb/light_paths/setup.h"', "that register"),
    ],
)
def test_a_bad_include_is_refused(tmp_path, name, line, message):
    result = run(tree(tmp_path, {name: line + "\n"}))
    assert result.returncode == 1
    assert f"src/wavecomb/{name}:2:" in result.stderr or "no known layer" in result.stderr
    assert message in result.stderr


def test_a_missing_licence_line_is_refused(tmp_path):
    path = tmp_path / "src" / "wavecomb" / "core" / "rng.h"
    path.parent.mkdir(parents=True)
    path.write_text("#pragma once\n")
    result = run(tmp_path)
    assert result.returncode == 1
    assert "SPDX" in result.stderr


def test_an_empty_tree_is_an_error(tmp_path):
    assert run(tmp_path).returncode == 2


def python_tree(root: pathlib.Path, files: dict[str, str]) -> pathlib.Path:
    for name, text in {"__init__.py": "", **files}.items():
        path = root / "python" / "wavecomb" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tree(root, {"core/rows/soa.h": ""})


def test_imports_that_point_down_pass(tmp_path):
    files = {
        "errors.py": "",
        "picture/__init__.py": "",
        "picture/files.py": "from wavecomb import _core\nfrom wavecomb.errors import Error\n",
        "cli/__init__.py": "from wavecomb.cli import render\n",
        "cli/render.py": "import wavecomb.picture.files\nfrom wavecomb import __version__\n",
        "__main__.py": "from wavecomb.cli import main\n",
    }
    result = run(python_tree(tmp_path, files))
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize(
    "other",
    [
        "from wavecomb.a import x\n",
        "import wavecomb.a\n",
        "def late():\n    from wavecomb import a\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from wavecomb.a import X\n",
    ],
)
def test_imports_in_a_circle_are_named(tmp_path, other):
    files = {"a.py": "from wavecomb.b import y\n", "b.py": "import wavecomb.c\n", "c.py": other}
    result = run(python_tree(tmp_path, files))
    assert result.returncode == 1
    assert "circle: wavecomb.a, wavecomb.b, wavecomb.c" in result.stderr


def test_nothing_but_the_command_imports_it(tmp_path):
    files = {
        "cli/__init__.py": "",
        "cli/group.py": "",
        "run.py": "from wavecomb.cli import group\n",
    }
    result = run(python_tree(tmp_path, files))
    assert result.returncode == 1
    assert "wavecomb.run may not import wavecomb.cli" in result.stderr


def test_materialx_is_behind_its_door(tmp_path):
    files = {
        "usd/__init__.py": "",
        "usd/materialx/__init__.py": "",
        "usd/materialx/nodes.py": "def late():\n    import MaterialX as mx\n",
        "usd/materialx/files.py": "from wavecomb.usd.materialx import nodes\n",
        "usd/mtlx.py": "def late():\n    from wavecomb.usd.materialx import files\n",
        "usd/load.py": "from wavecomb.usd import mtlx\n",
    }
    result = run(python_tree(tmp_path / "clean", files))
    assert result.returncode == 0, result.stderr
    files["usd/load.py"] = "def late():\n    from wavecomb.usd.materialx import files\n"
    files["usd/look.py"] = "import MaterialX.PyMaterialXCore\n"
    result = run(python_tree(tmp_path / "other", files))
    assert result.returncode == 1
    assert "wavecomb.usd.load may not import wavecomb.usd.materialx" in result.stderr
    assert "wavecomb.usd.look may not import MaterialX" in result.stderr
