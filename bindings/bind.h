// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

#include <utility>
#include <vector>

#include "wavecomb/scene/scene.h"

void bind_scene(nanobind::module_& m);
void bind_geometry(nanobind::module_& m);
void bind_volumes(nanobind::module_& m);
void bind_graphs(nanobind::module_& m);
void bind_lights(nanobind::module_& m);
void bind_camera(nanobind::module_& m);
void bind_recording(nanobind::module_& m);
void bind_watching(nanobind::module_& m);
void bind_settings(nanobind::module_& m);
void bind_render(nanobind::module_& m);
void bind_renderer(nanobind::module_& m);

/// Add methods to the Python class SceneBuilder: `def_materials` adds the methods for textures and
/// materials, `def_meshes` for meshes, curves, points and instances, and `def_volumes` for volumes.
void def_materials(nanobind::class_<wavecomb::SceneBuilder>& builder);
void def_meshes(nanobind::class_<wavecomb::SceneBuilder>& builder);
void def_volumes(nanobind::class_<wavecomb::SceneBuilder>& builder);

/// Converts the dict with which SceneBuilder.add_material describes a texture lookup.
wavecomb::TextureUse texture_use(const nanobind::dict& d);

/// Adds a value graph from the arguments of SceneBuilder.add_graph.
uint32_t add_graph(wavecomb::SceneBuilder& builder, const nanobind::bytes& ops,
                   const std::vector<float>& constants,
                   const std::vector<std::pair<uint32_t, float>>& images,
                   const std::vector<std::pair<uint32_t, uint32_t>>& outputs,
                   const std::vector<std::string>& attributes);

/// Builds a mesh from each dict of `descriptions`. Returns a list with a dict for each mesh, or
/// with an error message (str) in place of a mesh that could not be built.
nanobind::list make_surfaces(const wavecomb::SceneBuilder& builder,
                             const nanobind::list& descriptions, uint32_t threads);
