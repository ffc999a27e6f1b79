// SPDX-License-Identifier: Apache-2.0
/// Functions that the kernels of all programs call without inlining: light sampling, guiding,
/// textures, curves, motion and value graphs. shared.lanes.cpp compiles these functions once for
/// each lane width and includes their bodies from the *.inl files.
#pragma once

#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/graph/run.h"
#include "wavecomb/guiding/lookup.h"
#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/material/inputs/graph_inputs.h"
#include "wavecomb/path/steps/emit.h"
#include "wavecomb/texture/lookup.h"

/// Instantiates or declares all shared functions. `KEYWORD` is empty or `extern`.
#define WAVECOMB_SHARED_KERNELS(KEYWORD, F)                                                        \
  KEYWORD template LightSample<F> sample_light<F>(const LightView&, const LightReceiver<F>&,       \
                                                  const F&, const F&, const F&, const Mask<F>&);   \
  KEYWORD template UInt<F> select_light_index<F>(const LightView&, const LightReceiver<F>&,        \
                                                 const F&, const Mask<F>&);                        \
  KEYWORD template LightHit<F> light_hit<F>(const LightView&, const UInt<F>&,                      \
                                            const LightReceiver<F>&, const Vec3<F>&, const F&,     \
                                            const Mask<F>&);                                       \
  KEYWORD template F triangle_light_pdf<F>(const LightView&, const UInt<F>&,                       \
                                           const LightReceiver<F>&, const Vec3<F>&, const F&,      \
                                           const Mask<F>&);                                        \
  KEYWORD template Emission<F> sample_emission<F>(const LightView&, const EmissionNumbers<F>&,     \
                                                  const Mask<F>&);                                 \
  KEYWORD template F emission_density<F>(const LightView&, const UInt<F>&, const Vec3<F>&,         \
                                         const Vec3<F>&, const F&, const Mask<F>&);                \
  KEYWORD template CameraPathDensity<F> camera_path_density<F>(                                    \
      const LightView&, const UInt<F>&, const LightReceiver<F>&, const Vec3<F>&, const F&,         \
      const Mask<F>&);                                                                             \
  KEYWORD template Color<F> mesh_light_emission<F>(const SceneView&, const UInt<F>&,               \
                                                   const UInt<F>&, const Color<F>&,                \
                                                   const PathState<F>&, bool, const Mask<F>&);     \
  KEYWORD template GuidingLookup<F> look_up_guiding<F>(                                            \
      const GuidingView&, const Vec3<F>&, const UInt<F>&, const UInt<F>&, const Mask<F>&);         \
  KEYWORD template F guiding_pdf<F>(const GuidingView&, const GuidingLookup<F>&, const Vec3<F>&,   \
                                    const Mask<F>&);                                               \
  KEYWORD template Vec3<F> sample_guiding<F>(const GuidingView&, const GuidingLookup<F>&,          \
                                             const F&, const F&, const Mask<F>&);                  \
  KEYWORD template void run_graph<F>(const GraphView&, const GraphProgram&, const TextureView*,    \
                                     const GraphPoint<F>&, const Mask<F>&, F*);                    \
  KEYWORD template GraphPoint<F> graph_point<F>(const SceneView&, const MeshHit<F>&,               \
                                                const Surface<F>&, const Vec3<F>&,                 \
                                                const Footprint<F>&, const Mask<F>&);              \
  KEYWORD template void detail::setup_curved<F>(                                                   \
      const SceneView&, const MeshHit<F>&, const Vec3<F>&, bool, const Mask<F>&, Surface<F>&);     \
  KEYWORD template Vec3<F> detail::read_texture<F>(const MaterialView&,                            \
                                                   const detail::RecordReader<F>&, const Vec2<F>&, \
                                                   const Footprint<F>&, const Mask<F>&);           \
  KEYWORD template Texel<F> lookup<F>(const TextureView&, const F&, const F&, const Footprint<F>&, \
                                      const Mask<F>&);                                             \
  KEYWORD template Texel<F> lookup<F>(const TextureView*, const UInt<F>&, const F&, const F&,      \
                                      const Footprint<F>&, const Mask<F>&);                        \
  KEYWORD template MovedInstance<F> moved_instance<F>(const SceneView&, const UInt<F>&, const F&,  \
                                                      const detail::InstanceMaps<F>&,              \
                                                      const Vec3<F>&, const Mask<F>&);             \
  KEYWORD template MovedTriangle<F> moved_triangle<F>(                                             \
      const SceneView&, const UInt<F>&, const UInt<F>&, const std::array<UInt<F>, 3>&, const F&,   \
      const detail::InstanceMaps<F>&, const Mask<F>&);                                             \
  KEYWORD template std::array<Vec3<F>, 3> moved_normals<F>(                                        \
      const SceneView&, const UInt<F>&, const std::array<UInt<F>, 3>&, const F&, const Mask<F>&)
