#include "topology/organ/organs.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <unordered_map>

namespace spherecut::topology {

namespace {

constexpr double most_triangles = 2e7;

void require_positive(double value, const char* name) {
  if (!(std::isfinite(value) && value > 0))
    throw InputError(fmt::format("{} = {} m: must be a positive number", name, value));
}

void require_affordable(double expected_area, double edge) {
  const double triangles = expected_area / (0.433 * edge * edge);
  if (triangles > most_triangles)
    throw InputError(fmt::format("edge = {} m would make about {:.2g} triangles: at most {:.0e}; choose a longer edge",
                                 edge, triangles, most_triangles));
}

/// One circle of vertices about the z axis; a radius of zero is a pole, a single vertex.
struct Ring {
  double radius; // m
  double height; // m
  int count;     // number of vertices
};

/// Number of segments of about `step` along `length`.
int segments(double length, double step) {
  return std::max(1, static_cast<int>(std::lround(length / step)));
}

/// Closed surface of revolution through rings listed from the lower pole to the upper pole.
/// Rings of equal count are staggered by half a segment and rings of different count start at the same angle, which
/// gives nearly equilateral triangles when the counts are 6k on successive rings or equal.
SurfaceMesh revolve(const std::vector<Ring>& rings) {
  constexpr double full_turn = 2 * std::numbers::pi;
  SurfaceMesh mesh;
  std::vector<int> first(rings.size());
  std::vector<double> start_angle(rings.size(), 0.0);
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const Ring& ring = rings[r];
    first[r] = static_cast<int>(mesh.vertices.size());
    if (r > 0) {
      start_angle[r] = start_angle[r - 1];
      if (ring.count == rings[r - 1].count)
        start_angle[r] += std::numbers::pi / ring.count;
    }
    for (int j = 0; j < ring.count; ++j) {
      const double angle = start_angle[r] + full_turn * j / ring.count;
      mesh.vertices.emplace_back(ring.radius * std::cos(angle), ring.radius * std::sin(angle), ring.height);
    }
  }
  for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
    const int below = rings[r].count, above = rings[r + 1].count;
    const auto lower = [&](int j) { return first[r] + j % below; };
    const auto upper = [&](int j) { return first[r + 1] + j % above; };
    const auto lower_angle = [&](int j) { return start_angle[r] + full_turn * j / below; };
    const auto upper_angle = [&](int j) { return start_angle[r + 1] + full_turn * j / above; };
    // Zip the two rings: always close the triangle whose new spoke is less oblique.
    const int lower_steps = below == 1 ? 0 : below, upper_steps = above == 1 ? 0 : above;
    for (int a = 0, b = 0; a < lower_steps || b < upper_steps;) {
      const bool step_below =
          b == upper_steps || (a < lower_steps && std::abs(lower_angle(a + 1) - upper_angle(b)) <
                                                      std::abs(upper_angle(b + 1) - lower_angle(a)) + 1e-9);
      if (step_below) {
        mesh.triangles.push_back({lower(a), lower(a + 1), upper(b)});
        ++a;
      } else {
        mesh.triangles.push_back({lower(a), upper(b + 1), upper(b)});
        ++b;
      }
    }
  }
  return mesh;
}

/// Rings of a flat disc from its centre outwards, the rim left out: 6k vertices on ring k.
std::vector<Ring> disc_rings(double radius, double height, int rings) {
  std::vector<Ring> result{{0, height, 1}};
  for (int k = 1; k < rings; ++k)
    result.push_back({radius * k / rings, height, 6 * k});
  return result;
}

} // namespace

SurfaceMesh make_block(const Vector3& size, double edge) {
  return make_block(Vector3(-size.x() / 2, -size.y() / 2, 0), Vector3(size.x() / 2, size.y() / 2, size.z()), edge);
}

SurfaceMesh make_block(const Vector3& lower, const Vector3& upper, double edge) {
  require_positive(edge, "edge");
  const Vector3 size = upper - lower;
  require_positive(size.x(), "block size x");
  require_positive(size.y(), "block size y");
  require_positive(size.z(), "block size z");
  require_affordable(2 * (size.x() * size.y() + size.y() * size.z() + size.z() * size.x()), edge);
  const std::array<int, 3> n = {segments(size.x(), edge), segments(size.y(), edge), segments(size.z(), edge)};

  SurfaceMesh mesh;
  std::unordered_map<std::int64_t, int> vertex_of_lattice_point;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const std::int64_t key = at[0] + (n[0] + 1LL) * (at[1] + (n[1] + 1LL) * at[2]);
    const auto [entry, inserted] = vertex_of_lattice_point.emplace(key, static_cast<int>(mesh.vertices.size()));
    if (inserted) {
      Vector3 position;
      for (int d = 0; d < 3; ++d)
        position[d] = std::lerp(lower[d], upper[d], static_cast<double>(at[d]) / n[d]);
      mesh.vertices.push_back(position);
    }
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const bool top : {false, true}) {
      // u, v, outward axis form a right-handed frame.
      const int u = (axis + (top ? 1 : 2)) % 3, v = (axis + (top ? 2 : 1)) % 3;
      for (int j = 0; j < n[v]; ++j)
        for (int i = 0; i < n[u]; ++i) {
          std::array<int, 3> corner{};
          corner[axis] = top ? n[axis] : 0;
          const auto at = [&](int du, int dv) {
            corner[u] = i + du;
            corner[v] = j + dv;
            return vertex(corner);
          };
          const int a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
          if ((i + j) % 2 == 0) {
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({a, c, d});
          } else {
            mesh.triangles.push_back({a, b, d});
            mesh.triangles.push_back({b, c, d});
          }
        }
    }
  return mesh;
}

SurfaceMesh make_cylinder(double radius, double height, double edge) {
  require_positive(radius, "cylinder radius");
  require_positive(height, "cylinder height");
  require_positive(edge, "edge");
  require_affordable(2 * std::numbers::pi * radius * (radius + height), edge);
  const int cap_rings = segments(radius, edge);
  const int rows = segments(height, edge * std::numbers::sqrt3 / 2);

  std::vector<Ring> rings = disc_rings(radius, 0, cap_rings);
  for (int row = 0; row <= rows; ++row)
    rings.push_back({radius, height * row / rows, 6 * cap_rings});
  const std::vector<Ring> cap = disc_rings(radius, height, cap_rings);
  rings.insert(rings.end(), cap.rbegin(), cap.rend());
  return revolve(rings);
}

SurfaceMesh make_hemisphere(double radius, double edge) {
  require_positive(radius, "hemisphere radius");
  require_positive(edge, "edge");
  require_affordable(3 * std::numbers::pi * radius * radius, edge);
  const int base_rings = segments(radius, edge);
  const int rows = segments(std::numbers::pi / 2 * radius, edge) + 1;

  std::vector<Ring> rings = disc_rings(radius, 0, base_rings);
  rings.push_back({radius, 0, 6 * base_rings});
  for (int row = 1; row < rows; ++row) {
    const double latitude = std::numbers::pi / 2 * row / rows;
    const int sectors = std::max(1, static_cast<int>(std::lround(base_rings * std::cos(latitude))));
    rings.push_back({radius * std::cos(latitude), radius * std::sin(latitude), 6 * sectors});
  }
  rings.push_back({0, radius, 1});
  return revolve(rings);
}

} // namespace spherecut::topology
