// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/scene/scene.h"

void bind_scene(nanobind::module_& m);
void bind_geometry(nanobind::module_& m);
void bind_recording(nanobind::module_& m);
void bind_watching(nanobind::module_& m);
void bind_render(nanobind::module_& m);
void bind_renderer(nanobind::module_& m);

/// A texture use as SceneBuilder.add_material takes it.
wavecomb::TextureUse texture_use(const nanobind::dict& d);

/// Each description's mesh, or the line that says why there is none.
nanobind::list make_surfaces(const wavecomb::SceneBuilder& builder,
                             const nanobind::list& descriptions, uint32_t threads);
