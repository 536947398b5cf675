// Exact distances between points, segments and triangles. Inline: they are the innermost loop of every contact query.
#pragma once

#include "topology/base/types.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace spherecut::topology {

/// Where on a triangle abc a point lies: the face, an edge (ab, bc, ca) or a corner.
enum class TriangleFeature : std::uint8_t { face, edge_ab, edge_bc, edge_ca, corner_a, corner_b, corner_c };

struct TrianglePoint {
  Vector3 point;
  TriangleFeature feature;
};

/// Point of the triangle abc closest to p, by the Voronoi region of p [Ericson 2005, sec. 5.1.5].
inline TrianglePoint closest_on_triangle(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c) {
  const Vector3 ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0)
    return {a, TriangleFeature::corner_a};
  const Vector3 bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3)
    return {b, TriangleFeature::corner_b};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0)
    return {a + d1 / (d1 - d3) * ab, TriangleFeature::edge_ab};
  const Vector3 cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6)
    return {c, TriangleFeature::corner_c};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0)
    return {a + d2 / (d2 - d6) * ac, TriangleFeature::edge_ca};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return {b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b), TriangleFeature::edge_bc};
  const double scale = 1 / (va + vb + vc);
  return {a + vb * scale * ab + vc * scale * ac, TriangleFeature::face};
}

struct SegmentPair {
  double along;    // 0..1 on the first segment
  Vector3 point;   // on the second segment
  double distance; // m
};

/// Closest points of the segments p0 p1 and q0 q1 [Ericson 2005, sec. 5.1.9].
inline SegmentPair closest_between_segments(const Vector3& p0, const Vector3& p1, const Vector3& q0,
                                            const Vector3& q1) {
  const Vector3 d1 = p1 - p0, d2 = q1 - q0, r = p0 - q0;
  const double a = d1.squaredNorm(), e = d2.squaredNorm(), f = d2.dot(r), c = d1.dot(r), b = d1.dot(d2);
  const double denominator = a * e - b * b;
  double s = denominator > 1e-14 * a * e ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0;
  double t = e > 0 ? (b * s + f) / e : 0;
  if (t < 0 || t > 1 || !(denominator > 1e-14 * a * e)) {
    t = std::clamp(t, 0.0, 1.0);
    s = a > 0 ? std::clamp((b * t - c) / a, 0.0, 1.0) : 0;
    t = e > 0 ? std::clamp((b * s + f) / e, 0.0, 1.0) : 0;
  }
  const Vector3 on_first = p0 + s * d1, on_second = q0 + t * d2;
  return {s, on_second, (on_first - on_second).norm()};
}

struct Crossing {
  bool found;
  double along; // 0..1 on the segment
};

/// Whether the segment p q meets the triangle abc, its border included up to a billionth of its size.
inline Crossing segment_crosses_triangle(const Vector3& p, const Vector3& q, const Vector3& a, const Vector3& b,
                                         const Vector3& c) {
  const Vector3 ab = b - a, ac = c - a, normal = ab.cross(ac);
  const double hp = normal.dot(p - a), hq = normal.dot(q - a);
  if ((hp > 0 && hq > 0) || (hp < 0 && hq < 0) || hp == hq)
    return {false, 0};
  const double along = hp / (hp - hq);
  const Vector3 ax = p + along * (q - p) - a;
  const double area2 = normal.squaredNorm();
  const double v = normal.dot(ax.cross(ac)) / area2, w = normal.dot(ab.cross(ax)) / area2;
  constexpr double slack = 1e-9;
  return {v >= -slack && w >= -slack && v + w <= 1 + slack, along};
}

/// Closest points of the segment p q and the triangle abc; at a crossing the distance is zero.
inline SegmentPair closest_segment_triangle(const Vector3& p, const Vector3& q, const Vector3& a, const Vector3& b,
                                            const Vector3& c) {
  const Crossing crossing = segment_crosses_triangle(p, q, a, b, c);
  if (crossing.found)
    return {crossing.along, p + crossing.along * (q - p), 0};
  const Vector3 from_p = closest_on_triangle(p, a, b, c).point, from_q = closest_on_triangle(q, a, b, c).point;
  SegmentPair best{0, from_p, (from_p - p).norm()};
  const auto keep = [&](const SegmentPair& pair) {
    if (pair.distance < best.distance)
      best = pair;
  };
  keep({1, from_q, (from_q - q).norm()});
  keep(closest_between_segments(p, q, a, b));
  keep(closest_between_segments(p, q, b, c));
  keep(closest_between_segments(p, q, c, a));
  return best;
}

} // namespace spherecut::topology
