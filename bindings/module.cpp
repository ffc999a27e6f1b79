// SPDX-License-Identifier: Apache-2.0
/// The Python module wavecomb._core: thin, no logic. Documented in python/wavecomb/_core.pyi.
#include <nanobind/nanobind.h>

#include "bind.h"
#include "wavecomb/core/error.h"

namespace nb = nanobind;

NB_MODULE(_core, m) {
  m.doc() = "The native core of Wavecomb.";
  // What lives when the interpreter ends, a window's last picture or an exception's, is no news to
  // those who render; the list would also name other modules' objects.
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
