// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

void bind_scene(nanobind::module_& m);
void bind_recording(nanobind::module_& m);
void bind_watching(nanobind::module_& m);
void bind_render(nanobind::module_& m);
void bind_renderer(nanobind::module_& m);
