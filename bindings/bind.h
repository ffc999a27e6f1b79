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

/// Define parts of class SceneBuilder: textures and materials; meshes, curves, points and
/// instances; volumes.
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

/// Builds a mesh from each description dict. Returns a list of dicts, or of error messages (str)
/// for descriptions that fail.
nanobind::list make_surfaces(const wavecomb::SceneBuilder& builder,
                             const nanobind::list& descriptions, uint32_t threads);
