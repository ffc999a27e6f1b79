// SPDX-License-Identifier: Apache-2.0
/// Python module wavecomb._core, which makes the C++ core available in Python. The stub file
/// python/wavecomb/_core.pyi documents the module.
#include <nanobind/nanobind.h>

#include "bind.h"
#include "wavecomb/core/error.h"

namespace nb = nanobind;

NB_MODULE(_core, m) {
  m.doc() = "The native core of Wavecomb.";
  // Disable nanobind's leak warnings: objects that are alive at interpreter exit, such as a
  // window's last image or an object held by an exception, are harmless, and the warnings would
  // also list objects of other modules.
  nb::set_leak_warnings(false);
  nb::exception<wavecomb::Error>(m, "Error", PyExc_ValueError);
  bind_volumes(m);
  bind_scene(m);
  bind_geometry(m);
  bind_lights(m);
  bind_camera(m);
  bind_graphs(m);
  bind_recording(m);
  bind_watching(m);
  bind_settings(m);
  bind_render(m);
  bind_renderer(m);
}
