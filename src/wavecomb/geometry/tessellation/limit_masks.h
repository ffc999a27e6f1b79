// SPDX-License-Identifier: Apache-2.0
/// Evaluation of OpenSubdiv's vertex masks in bands of vertices, on any number of threads.
///
/// OpenSubdiv's Far::PrimvarRefiner computes the same values, but processes a whole level per call
/// on one thread. The functions here use the masks and the order of additions of OpenSubdiv, so
/// their results are bitwise equal. These functions require uniform refinement, in which every
/// vertex has all its neighbours.
#pragma once

#include <opensubdiv/far/topologyLevel.h>
#include <opensubdiv/sdc/bilinearScheme.h>
#include <opensubdiv/sdc/catmarkScheme.h>
#include <opensubdiv/sdc/loopScheme.h>

#include <algorithm>
#include <vector>

#include "wavecomb/scene/parallel.h"

namespace wavecomb::masks {

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

/// Elements per task.
inline constexpr size_t kBand = 4096;

/// Primvar value of N floats with the interface that OpenSubdiv expects.
template <int N>
struct Values {
  float v[N];
  void Clear() { std::fill(v, v + N, 0.f); }
  void AddWithWeight(const Values& other, float weight) {
    for (int i = 0; i < N; ++i) v[i] += weight * other.v[i];
  }
};

/// Weights of a vertex, its edges and its faces, with the interface that Sdc::Scheme expects.
class Mask {
 public:
  using Weight = float;

  /// Clears the mask and makes room for a vertex with `around` edges or faces, or for an edge with
  /// `around` faces.
  void fit(int around) {
    const size_t size = 1 + 2 * (static_cast<size_t>(around) + 2);
    if (weights_.size() < size) weights_.resize(size);
    faces_at_ = 1 + static_cast<size_t>(around) + 2;
    vertices_ = edges_ = faces_ = 0;
    for_centers_ = false;
  }

  int GetNumVertexWeights() const { return vertices_; }
  int GetNumEdgeWeights() const { return edges_; }
  int GetNumFaceWeights() const { return faces_; }
  void SetNumVertexWeights(int count) { vertices_ = count; }
  void SetNumEdgeWeights(int count) { edges_ = count; }
  void SetNumFaceWeights(int count) { faces_ = count; }
  bool AreFaceWeightsForFaceCenters() const { return for_centers_; }
  void SetFaceWeightsForFaceCenters(bool on) { for_centers_ = on; }

  // The mask of an edge has two vertex weights and no edge weights.
  float& VertexWeight(int i) { return weights_[static_cast<size_t>(i)]; }
  float& EdgeWeight(int i) { return weights_[1 + static_cast<size_t>(i)]; }
  float& FaceWeight(int i) { return weights_[faces_at_ + static_cast<size_t>(i)]; }
  const float& VertexWeight(int i) const { return weights_[static_cast<size_t>(i)]; }
  const float& EdgeWeight(int i) const { return weights_[1 + static_cast<size_t>(i)]; }
  const float& FaceWeight(int i) const { return weights_[faces_at_ + static_cast<size_t>(i)]; }

 private:
  std::vector<float> weights_;
  size_t faces_at_ = 0;
  int vertices_ = 0, edges_ = 0, faces_ = 0;
  bool for_centers_ = false;
};

/// Faces around an edge, with the interface that Sdc::Scheme expects of an edge.
struct EdgeAround {
  const Far::TopologyLevel& level;
  int edge;

  int GetNumFaces() const { return level.GetEdgeFaces(edge).size(); }
  float GetSharpness() const { return level.GetEdgeSharpness(edge); }
  void GetChildSharpnesses(const Sdc::Crease&, float* s) const {
    s[0] = s[1] = GetSharpness() - 1.f;
  }
  void GetNumVerticesPerFace(int* counts) const {
    const Far::ConstIndexArray faces = level.GetEdgeFaces(edge);
    for (int i = 0; i < faces.size(); ++i) counts[i] = level.GetFaceVertices(faces[i]).size();
  }
};

/// Neighbourhood of a vertex and its child on the next level, as Sdc::Scheme expects them.
struct VertexAround {
  const Far::TopologyLevel &level, &next;
  int vertex, child;

  int GetNumEdges() const { return level.GetVertexEdges(vertex).size(); }
  int GetNumFaces() const { return level.GetVertexFaces(vertex).size(); }
  float GetSharpness() const { return level.GetVertexSharpness(vertex); }
  float* GetSharpnessPerEdge(float* out) const {
    const Far::ConstIndexArray edges = level.GetVertexEdges(vertex);
    for (int i = 0; i < edges.size(); ++i) out[i] = level.GetEdgeSharpness(edges[i]);
    return out;
  }
  float GetChildSharpness(const Sdc::Crease&) const { return next.GetVertexSharpness(child); }
  float* GetChildSharpnessPerEdge(const Sdc::Crease& crease, float* out) const {
    std::vector<float> here(static_cast<size_t>(GetNumEdges()));
    crease.SubdivideEdgeSharpnessesAroundVertex(GetNumEdges(), GetSharpnessPerEdge(here.data()),
                                                out);
    return out;
  }
};

/// Runs f(i) for i from 0 to n - 1 in parallel bands. make() returns a separate f, with its own
/// scratch memory, for each band.
template <typename Make>
void in_bands(int n, Make&& make) {
  parallel_bands(static_cast<size_t>(n), kBand, [&](size_t first, size_t last) {
    auto f = make();
    for (size_t i = first; i < last; ++i) f(static_cast<int>(i));
  });
}

/// Returns the end vertex of an edge other than `vertex`.
inline int other_end(const Far::TopologyLevel& level, int edge, int vertex) {
  const Far::ConstIndexArray ends = level.GetEdgeVertices(edge);
  return ends[0] == vertex ? ends[1] : ends[0];
}

/// Returns the vertex of a face that is two corners after `corner`.
inline int opposite(const Far::TopologyLevel& level, int face, int corner) {
  const Far::ConstIndexArray points = level.GetFaceVertices(face);
  const int at = corner + 2;
  return points[at >= points.size() ? at - points.size() : at];
}

/// Refines values from a subdivision level to the next finer level `next`.
template <Sdc::SchemeType kScheme, typename V>
void refine(const Sdc::Options& options, const Far::TopologyLevel& level,
            const Far::TopologyLevel& next, const V* from, V* to) {
  const Sdc::Scheme<kScheme> scheme(options);
  // Compute the child vertices of faces first, since the child vertices of edges and vertices
  // depend on them. Loop subdivision has no child vertices of faces.
  if constexpr (kScheme != Sdc::SCHEME_LOOP)
    in_bands(level.GetNumFaces(), [&] {
      return [&, weights = std::vector<float>()](int face) mutable {
        const Far::ConstIndexArray points = level.GetFaceVertices(face);
        weights.resize(static_cast<size_t>(points.size()));
        V& out = to[level.GetFaceChildVertex(face)];
        out.Clear();
        const float share = 1.f / static_cast<float>(points.size());
        for (const int point : points) out.AddWithWeight(from[point], share);
      };
    });
  in_bands(level.GetNumEdges(), [&] {
    return [&, mask = Mask()](int edge) mutable {
      const int child = level.GetEdgeChildVertex(edge);
      const Far::ConstIndexArray ends = level.GetEdgeVertices(edge);
      const Far::ConstIndexArray faces = level.GetEdgeFaces(edge);
      mask.fit(faces.size());
      scheme.ComputeEdgeVertexMask(
          EdgeAround{level, edge}, mask,
          level.GetEdgeSharpness(edge) > 0 ? Sdc::Crease::RULE_CREASE : Sdc::Crease::RULE_SMOOTH,
          next.GetVertexRule(child));
      V& out = to[child];
      out.Clear();
      for (int i = 0; i < 2; ++i) out.AddWithWeight(from[ends[i]], mask.VertexWeight(i));
      if (mask.GetNumFaceWeights() == 0) return;
      for (int i = 0; i < faces.size(); ++i) {
        if (mask.AreFaceWeightsForFaceCenters()) {
          out.AddWithWeight(to[level.GetFaceChildVertex(faces[i])], mask.FaceWeight(i));
        } else {
          const int corner = level.GetFaceEdges(faces[i]).FindIndex(edge);
          out.AddWithWeight(from[opposite(level, faces[i], corner)], mask.FaceWeight(i));
        }
      }
    };
  });
  in_bands(level.GetNumVertices(), [&] {
    return [&, mask = Mask()](int vertex) mutable {
      const int child = level.GetVertexChildVertex(vertex);
      const Far::ConstIndexArray edges = level.GetVertexEdges(vertex);
      const Far::ConstIndexArray faces = level.GetVertexFaces(vertex);
      mask.fit(std::max(edges.size(), faces.size()));
      scheme.ComputeVertexVertexMask(VertexAround{level, next, vertex, child}, mask,
                                     level.GetVertexRule(vertex), next.GetVertexRule(child));
      V& out = to[child];
      out.Clear();
      if (mask.GetNumFaceWeights() > 0)
        for (int i = 0; i < faces.size(); ++i)
          out.AddWithWeight(to[level.GetFaceChildVertex(faces[i])], mask.FaceWeight(i));
      if (mask.GetNumEdgeWeights() > 0)
        for (int i = 0; i < edges.size(); ++i)
          out.AddWithWeight(from[other_end(level, edges[i], vertex)], mask.EdgeWeight(i));
      out.AddWithWeight(from[vertex], mask.VertexWeight(0));
    };
  });
}

/// Computes limit values of the vertices of the last level. Calls out(vertex, value, u, v), where u
/// and v point to the derivatives. u and v are null if kTangents is false, and at vertices without
/// faces.
template <Sdc::SchemeType kScheme, bool kTangents, typename V, typename Out>
void limit(const Sdc::Options& options, const Far::TopologyLevel& level, const V* from, Out&& out) {
  const Sdc::Scheme<kScheme> scheme(options);
  in_bands(level.GetNumVertices(), [&] {
    return [&, position = Mask(), u = Mask(), v = Mask()](int vertex) mutable {
      const Far::ConstIndexArray edges = level.GetVertexEdges(vertex);
      V value, by_u, by_v;
      value.Clear();
      if (edges.size() == 0) {  // an isolated vertex
        value.AddWithWeight(from[vertex], 1.f);
        out(vertex, value, static_cast<const V*>(nullptr), static_cast<const V*>(nullptr));
        return;
      }
      const Far::ConstIndexArray faces = level.GetVertexFaces(vertex);
      const Far::ConstLocalIndexArray corners = level.GetVertexFaceLocalIndices(vertex);
      const VertexAround around{level, level, vertex, vertex};
      const auto add = [&](V& sum, Mask& mask) {
        sum.Clear();
        for (int i = 0; i < mask.GetNumFaceWeights(); ++i)
          sum.AddWithWeight(from[opposite(level, faces[i], corners[i])], mask.FaceWeight(i));
        for (int i = 0; i < mask.GetNumEdgeWeights(); ++i)
          sum.AddWithWeight(from[other_end(level, edges[i], vertex)], mask.EdgeWeight(i));
        sum.AddWithWeight(from[vertex], mask.VertexWeight(0));
      };
      for (Mask* mask : {&position, &u, &v}) mask->fit(std::max(edges.size(), faces.size()));
      if constexpr (kTangents) {
        scheme.ComputeVertexLimitMask(around, position, u, v, level.GetVertexRule(vertex));
        add(value, position);
        add(by_u, u);
        add(by_v, v);
        out(vertex, value, &by_u, &by_v);
      } else {
        scheme.ComputeVertexLimitMask(around, position, level.GetVertexRule(vertex));
        add(value, position);
        out(vertex, value, static_cast<const V*>(nullptr), static_cast<const V*>(nullptr));
      }
    };
  });
}

}  // namespace wavecomb::masks
