# SPDX-License-Identifier: Apache-2.0
"""MaterialX's library: supported nodes, and agreement of built-in nodes with its graphs.

The list in docs/material-graphs.md must be correct.
"""

from __future__ import annotations

import collections
import functools
import re
from pathlib import Path

import numpy as np
import pytest
from materialx_nodes import Node, patterns, points, run

from wavecomb.usd.materialx.library import WIDTHS, definition_of, flat_graph, library
from wavecomb.usd.materialx.nodes.network import PER_COMPONENT, primitive
from wavecomb.usd.materialx.nodes.node_graphs import CATEGORIES, ExpandedGraph

DOCS = Path(__file__).resolve().parents[2] / "docs" / "material-graphs.md"

CODE = "code in the library, which value graphs have no operation for"
HEIGHT = "differences between texels of a height"
MATRIX = "matrices are made, transposed and applied only"
HAIR = "inputs of hair"
REASONS = {
    "flake2d": CODE, "flake3d": CODE,
    "heighttonormal": HEIGHT, "bump": HEIGHT,
    "determinant": MATRIX, "invertmatrix": MATRIX,
    "roughness_anisotropy": "inputs of BSDF nodes", "roughness_dual": "inputs of BSDF nodes",
    "glossiness_anisotropy": "inputs of BSDF nodes", "artistic_ior": "inputs of BSDF nodes",
    "standard_surface_to_gltf_pbr": "inputs of BSDF nodes",
    "chiang_hair_roughness": HAIR,
}  # fmt: skip
"""Reasons for nodes that are recognised but not supported, by category."""


def library_of(identifier):
    return library().getNodeDef(identifier).getSourceUri().split("libraries/")[-1].split("/")[0]


def reason(identifier):
    if "_matrix" in identifier:
        return MATRIX
    return REASONS[definition_of(identifier).category]


def support_of(identifier):
    """Returns how a library node is compiled: "primitive", "graph", or "" if not at all."""
    definition = definition_of(identifier)
    if definition is None:
        return ""
    if primitive(definition.category, identifier) is not None:
        return "primitive"
    graph = flat_graph(identifier, CATEGORIES)
    if graph is None:
        return ""
    known = (primitive(node.category, node.identifier) for node in graph.nodes.values())
    return "graph" if all(one is not None for one in known) else ""


@functools.cache
def by_category(*support):
    """Returns definitions with the given kinds of support, by category."""
    found = collections.defaultdict(list)
    for identifier in patterns():
        if support_of(identifier) in support:
            found[definition_of(identifier).category].append(identifier)
    return found


def test_all_nodes_are_read_or_named_with_a_reason():
    counts, named = collections.Counter(), collections.defaultdict(set)
    for identifier in patterns():
        support = support_of(identifier)
        counts[library_of(identifier), support or "named"] += 1
        if not support:
            named[reason(identifier)].add(definition_of(identifier).category)
    text = DOCS.read_text()
    for folder in ("stdlib", "nprlib", "pbrlib", "cmlib", "bxdf"):
        row = [counts[folder, how] for how in ("primitive", "graph", "named")]
        assert f"| {folder} | {row[0]} | {row[1]} | {row[2]} |" in text, (folder, row)
    for why, categories in named.items():
        line = f"- {', '.join(f'`{name}`' for name in sorted(categories))}: {why}"
        assert re.sub(r"\s+", " ", line) in re.sub(r"\s+", " ", text), line
    table = text[text.index("| | primitives |") : text.index("All other nodes are compiled")]
    # Nodes of Arnold are not part of the library; docs/materialx.md lists them.
    library_s = {name for name in CATEGORIES if not name.startswith("arnold_")}
    assert set(re.findall(r"`(\w+)`", table)) == library_s
    assert not REASONS.keys() - {name for names in named.values() for name in names}


@pytest.mark.parametrize("category", sorted(by_category("primitive", "graph")))
def test_no_node_that_is_read_says_anything(category):
    """The first and last type of each node compile to the right width without warnings."""
    variants = by_category("primitive", "graph")[category]
    for identifier in {variants[0], variants[-1]}:
        node = Node(identifier).feed_at_random()
        for output in patterns()[identifier]:
            value = node.value(output)
            kind = definition_of(identifier).outputs[output]
            assert value is not None and len(value) == WIDTHS[kind], (identifier, output)
        assert "MaterialX" not in "\n".join(node.report.lines()), identifier


def both_ways():
    """Yields nodes that Wavecomb implements although the library has graphs for these nodes."""
    for identifier in patterns():
        category = definition_of(identifier).category
        is_here = primitive(category, identifier) is not None or category in PER_COMPONENT
        if is_here and flat_graph(identifier, CATEGORIES) is not None:
            yield identifier


@pytest.mark.parametrize("identifier", sorted(both_ways()))
def test_what_is_written_here_is_the_library_s_graph(identifier):
    """The implementation equals the library's graph bit for bit on random inputs."""
    at = points()
    node = Node(identifier).feed_at_random()
    if identifier.startswith("ND_UsdUVTexture"):
        node.give(file="a.png", wrapS="clamp")
    if identifier.startswith("ND_UsdPrimvarReader"):
        node.give(varname="wear")
    for output in patterns()[identifier]:
        ours = node.value(output)
        graph = flat_graph(identifier, CATEGORIES)
        theirs = ExpandedGraph(node.call(output), graph).output(output)
        if ours == theirs:  # identical value graphs
            continue
        assert np.array_equal(run(ours, at), run(theirs, at), equal_nan=True), output


@pytest.mark.parametrize("category", sorted(by_category("primitive")))
def test_defaults_of_primitives_are_the_library_s(category):
    """A node without inputs equals a node with all inputs set to the defaults of its definition."""
    for identifier in by_category("primitive")[category]:
        bare, full = Node(identifier), Node(identifier)
        full.networks.make = bare.networks.make
        for item in full.definition.getActiveInputs():
            kind, text = item.getType(), item.getValueString()
            if kind in WIDTHS and text and not item.getDefaultGeomPropString():
                full.give(**{item.getName(): text})
        if identifier in ("ND_image_color4", "ND_image_vector4", "ND_hextiledimage_color4"):
            full.give(default="0, 0, 0, 1")
        for output in patterns()[identifier]:
            ours, theirs = bare.value(output), full.value(output)
            if all(isinstance(x, float) for x in (*ours, *theirs)):  # folded constants
                theirs = pytest.approx(theirs, rel=1e-5)
            assert ours == theirs, (identifier, output)


def test_definitions_are_made_flat_once():
    first = flat_graph("ND_ramp", CATEGORIES)
    assert first is flat_graph("ND_ramp", CATEGORIES)
    order = list(first.nodes)
    for name, inner in first.nodes.items():
        assert inner.category in CATEGORIES
        for feed in inner.inputs.values():
            assert not feed.node or order.index(feed.node) < order.index(name)
