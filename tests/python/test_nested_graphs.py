# SPDX-License-Identifier: Apache-2.0
"""Tests small MaterialX documents whose nested definitions expand to billions of nodes."""

import time

import pytest
from parts import needs
from usd_recorder import load, said

pytestmark = needs("MaterialX")

BASE = """
  <nodedef name="ND_n0" node="n0">
    <input name="a" type="color3" value="0, 0, 0" />
    <output name="out" type="color3" />
  </nodedef>
  <nodegraph name="NG_n0" nodedef="ND_n0">
    <multiply name="m" type="color3">
      <input name="in1" type="color3" interfacename="a" />
      <input name="in2" type="color3" value="0.5, 0.25, 0.75" />
    </multiply>
    <output name="out" type="color3" nodename="m" />
  </nodegraph>"""
LEVEL = """
  <nodedef name="ND_n{k}" node="n{k}">
    <input name="a" type="color3" value="0, 0, 0" />
    <output name="out" type="color3" />
  </nodedef>
  <nodegraph name="NG_n{k}" nodedef="ND_n{k}">
    <n{below} name="p" type="color3"><input name="a" type="color3" interfacename="a" /></n{below}>
    <n{below} name="q" type="color3"><input name="a" type="color3" {feed} /></n{below}>
    <add name="m" type="color3">
      <input name="in1" type="color3" nodename="p" />
      <input name="in2" type="color3" nodename="q" />
    </add>
    <output name="out" type="color3" nodename="m" />
  </nodegraph>"""
TOP = """
  <nodegraph name="G">
    <n{k} name="top" type="color3"><input name="a" type="color3" value="{value}" /></n{k}>
    <output name="out" type="color3" nodename="top" />
  </nodegraph>
  <open_pbr_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="G" output="out" />
  </open_pbr_surface>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S" />
  </surfacematerial>"""
BOTH = 'interfacename="a"'
CHAINED = 'nodename="p"'
STAGE = """def Scope "MaterialX" ( references = @./deep.mtlx@</MaterialX> ) { }
def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    rel material:binding = </MaterialX/Materials/M>
}"""


def document(folder, depth, feed, value):
    levels = "".join(LEVEL.format(k=k, below=k - 1, feed=feed) for k in range(1, depth + 1))
    text = '<?xml version="1.0"?>\n<materialx version="1.39">'
    text += BASE + levels + TOP.format(k=depth, value=value) + "\n</materialx>\n"
    (folder / "deep.mtlx").write_text(text)


@pytest.mark.slow
def test_a_chain_that_doubles(tmp_path):
    """Each level of nested graphs uses the level below twice: 2^32 nodes, with only 33
    different values.
    """
    depth = 32
    document(tmp_path, depth, BOTH, ", ".join([str(0.5**depth)] * 3))
    started = time.process_time()
    scene, loaded = load(tmp_path, STAGE)
    assert scene.material_of("Ball")["base_color"] == pytest.approx((0.5, 0.25, 0.75), rel=1e-5)
    assert not loaded.report.warnings and not loaded.report.unsupported
    assert time.process_time() - started < 60  # it takes about 2 s


def test_a_chain_of_different_values_is_listed(tmp_path):
    """A network of 2^30 nodes whose values all differ is reported as too large."""
    document(tmp_path, 30, CHAINED, "1, 1, 1")
    scene, loaded = load(tmp_path, STAGE)
    what = (
        "not supported: shading network of more than 1000 nodes (left out): /MaterialX/Materials/M"
    )
    assert what in said(loaded)
    assert scene.material_of("Ball")["base_color"] == (0.8, 0.8, 0.8)  # the default


@pytest.mark.parametrize("feed", [BOTH, CHAINED])
def test_instances_give_what_prims_of_their_own_give(tmp_path, monkeypatch, feed):
    from wavecomb.usd.materialx import graphs

    found = []
    for name, limits in (("apart", (10**6, 10**6)), ("shared", (4, 2))):
        folder = tmp_path / name
        folder.mkdir()
        monkeypatch.setattr(graphs, "MAX_EXPANDED", limits[0])
        monkeypatch.setattr(graphs, "_SMALL", limits[1])
        document(folder, 5, feed, "0.03, 0.02, 0.04")
        scene, loaded = load(folder, STAGE)
        assert not loaded.report.unsupported
        found.append(scene.material_of("Ball")["base_color"])

    # Expected value of level k, which applies level k - 1 twice.
    def level(k, x, s):
        if k == 0:
            return s * x
        p = level(k - 1, x, s)
        return p + level(k - 1, x if feed == BOTH else p, s)

    scales = zip((0.03, 0.02, 0.04), (0.5, 0.25, 0.75), strict=True)
    expected = tuple(level(5, x, s) for x, s in scales)
    assert found[0] == pytest.approx(expected, rel=1e-5) and found[0] == found[1]


def test_values_that_vary_go_through_instances(tmp_path, monkeypatch):
    from wavecomb.usd.materialx import graphs

    monkeypatch.setattr(graphs, "MAX_EXPANDED", 4)
    monkeypatch.setattr(graphs, "_SMALL", 2)
    document(tmp_path, 4, BOTH, "0, 0, 0")
    path = tmp_path / "deep.mtlx"
    place = '<position name="P" type="vector3" /><convert name="C" type="color3">'
    place += '<input name="in" type="vector3" nodename="P" /></convert>'
    text = path.read_text().replace('value="0, 0, 0" /></n4>', 'nodename="C" /></n4>')
    path.write_text(text.replace('<nodegraph name="G">', f'<nodegraph name="G">{place}'))
    scene, loaded = load(tmp_path, STAGE)
    assert not loaded.report.unsupported
    assert scene.material_of("Ball")["graph"] is not None and len(scene.graphs) == 1
