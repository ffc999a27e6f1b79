// SPDX-License-Identifier: Apache-2.0
/// Functions that the kernels of all programs call without inlining: sampling, surfaces, lights,
/// guiding, textures, motion, value graphs, AOVs and light path vertices. shared.lanes.cpp compiles
/// these functions once for each lane width and includes their bodies from the *.inl files.
#pragma once

#include "wavecomb/aov/path_events.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/graph/run.h"
#include "wavecomb/guiding/lookup.h"
#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light/filters/shadow.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/material/inputs/graph_inputs.h"
#include "wavecomb/material/params.h"
#include "wavecomb/path/camera/camera_connection.h"
#include "wavecomb/path/steps/emit.h"
#include "wavecomb/texture/lookup.h"
#include "wavecomb/wave/joint_transport.h"

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
      const SceneView&, const UInt<F>&, const std::array<UInt<F>, 3>&, const F&, const Mask<F>&);  \
  KEYWORD template struct detail::MatrixPair<F>;                                                   \
  KEYWORD template Sample4<F> sample_4d<F>(SamplerKind, const SampleKey<F>&, uint32_t);            \
  KEYWORD template Surface<F> setup_surface<F>(const SceneView&, const MeshHit<F>&,                \
                                               const Vec3<F>&, bool, bool, const Mask<F>&);        \
  KEYWORD template Vec3<F> detail::smooth_tangent<F>(const SceneView&, const MeshHit<F>&,          \
                                                     const std::array<UInt<F>, 3>&,                \
                                                     const Vec3<F>&, const Mask<F>&);              \
  KEYWORD template Vec2<F> hit_uv<F>(const MeshRecord*, const UInt<F>&, const UInt<F>&, const F&,  \
                                     const F&, const Mask<F>&);                                    \
  KEYWORD template void detail::drive_parameters<F, ShadingParams<F>>(                             \
      const MaterialView&, const UInt<F>&, const GraphPoint<F>&, const Mask<F>&,                   \
      ShadingParams<F>&);                                                                          \
  KEYWORD template struct LightEffect<F>;                                                          \
  KEYWORD template ShadowExtent<F> shadow_extent<F>(const LightView&, const UInt<F>&, const F&,    \
                                                    const Mask<F>&);                               \
  KEYWORD template CameraConnection<F> connect_to_camera<F>(                                       \
      const CameraSetup&, const Vec3<F>&, const F&, const F&, const F&, const Mask<F>&);           \
  KEYWORD template void PathAovs::vertex<F>(uint32_t, const UInt<F>&, const VertexAovs<F>&,        \
                                            const PathState<F>&, const Mask<F>&) const;            \
  KEYWORD template void PathAovs::light<Technique::kEmitter, F>(                                   \
      const LightEvent<F>&, const UInt<F>&, const Mask<F>&) const;                                 \
  KEYWORD template void PathExpressions::add<F>(const UInt<F>&, const UInt<F>&, const Color<F>&,   \
                                                const Mask<F>&) const;                             \
  KEYWORD template void PathExpressions::scatter<F>(uint32_t, const UInt<F>&, const SampleKey<F>&, \
                                                    const VertexAovs<F>&, const Mask<F>&,          \
                                                    const Mask<F>&) const;                         \
  KEYWORD template void PathHistory::vertex<F>(uint32_t, const UInt<F>&, const ShadedVertex<F>&,   \
                                               const float*, const Mask<F>&);                      \
  WAVECOMB_SHARED_JOINT_TRANSPORT(KEYWORD, F)
