#include "experiments/remeshing_ledger/scenario.hpp"

#include "experiments/remeshing_ledger/organ_side.hpp"

#include "topology/organ/organs.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace spherecut::experiments::ledger {

namespace {

constexpr double pi = std::numbers::pi;

double cross(const Vector2& a, const Vector2& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Sheet of a rectangle that grows along u: columns of vertices at the given u, rows evenly from `low` to `high`.
topology::SurfaceMesh columns_sheet(const CutFrame& frame, const std::vector<double>& u, double low, double high,
                                    double edge) {
  topology::SurfaceMesh sheet;
  const int rows = std::max(2, static_cast<int>(std::ceil((high - low) / edge)));
  for (double along : u)
    for (int r = 0; r <= rows; ++r)
      sheet.vertices.emplace_back(frame.origin + along * frame.ahead + (low + (high - low) * r / rows) * frame.tangent);
  // Counter-clockwise seen from ahead x tangent, turned where that is not the normal.
  const bool turned = frame.ahead.cross(frame.tangent).dot(frame.normal) < 0;
  for (int c = 0; c + 1 < std::ssize(u); ++c)
    for (int r = 0; r < rows; ++r) {
      const int a = c * (rows + 1) + r, b = a + rows + 1;
      for (Triangle t : {Triangle{a, b, b + 1}, Triangle{a, b + 1, a + 1}}) {
        if (turned)
          std::swap(t[1], t[2]);
        sheet.triangles.push_back(t);
      }
    }
  return sheet;
}

std::vector<double> column_places(double from, double first_front, double step, int increment) {
  std::vector<double> u;
  const int before = std::max(1, static_cast<int>(std::ceil((first_front - from) / (5 * step))));
  for (int c = 0; c <= before; ++c)
    u.push_back(from + (first_front - from) * c / before);
  for (int k = 1; k <= increment; ++k)
    u.push_back(first_front + k * step);
  return u;
}

std::vector<std::vector<Vector3>> box_edges(const Vector3& lower, const Vector3& upper) {
  std::vector<std::vector<Vector3>> edges;
  const auto corner = [&](int bits) {
    Vector3 x;
    for (int d = 0; d < 3; ++d)
      x[d] = ((bits >> d) & 1) != 0 ? upper[d] : lower[d];
    return x;
  };
  for (int a = 0; a < 8; ++a)
    for (int d = 0; d < 3; ++d)
      if (((a >> d) & 1) == 0)
        edges.push_back({corner(a), corner(a | (1 << d))});
  return edges;
}

/// A plane's frame with (ahead, tangent, normal) counter-clockwise: ahead x tangent = normal.
CutFrame upright_frame(const Vector3& origin, const Vector3& ahead, const Vector3& tangent) {
  return {origin, ahead, ahead.cross(tangent), tangent};
}

} // namespace

bool inside(const std::vector<Vector2>& polygon, const Vector2& p) {
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector2 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    if (cross(b - a, p - a) < 0)
      return false;
  }
  return true;
}

std::vector<Vector3> border_in_plane(const Scenario& scenario) {
  // Box: its edges cross the plane in the corners of a convex polygon. Curved organs: edges of their surface do.
  std::vector<Vector3> corners;
  const auto add = [&](const Vector3& a, const Vector3& b) {
    const double ha = scenario.height(a), hb = scenario.height(b);
    if ((ha < 0) == (hb < 0))
      return false;
    corners.emplace_back(a + ha / (ha - hb) * (b - a));
    return true;
  };
  if (!scenario.sharp_edges.empty()) {
    for (const auto& edge : scenario.sharp_edges)
      add(edge.front(), edge.back());
    Vector3 middle = Vector3::Zero();
    for (const Vector3& x : corners)
      middle += x / static_cast<double>(corners.size());
    const Vector2 m = scenario.in_plane(middle);
    std::sort(corners.begin(), corners.end(), [&](const Vector3& a, const Vector3& b) {
      const Vector2 p = scenario.in_plane(a) - m, q = scenario.in_plane(b) - m;
      return std::atan2(p.y(), p.x()) < std::atan2(q.y(), q.x());
    });
  } else {
    // Walk from triangle to triangle across the edges that the plane crosses; of several loops the longest counts.
    const topology::SurfaceMesh& surface = scenario.domain->surface();
    const auto neighbours = topology::triangle_neighbours(surface);
    std::vector<char> done(surface.triangles.size(), 0);
    std::vector<Vector3> longest;
    for (int first = 0; first < std::ssize(surface.triangles); ++first) {
      corners.clear();
      for (int t = first, from = -1; t >= 0 && done[t] == 0;) {
        int next = -1;
        for (int e = 0; e < 3 && next < 0; ++e) {
          const Vector3 &a = surface.vertices[surface.triangles[t][e]],
                        &b = surface.vertices[surface.triangles[t][(e + 1) % 3]];
          if (neighbours[t][e] != from && (scenario.height(a) < 0) != (scenario.height(b) < 0)) {
            add(a, b);
            next = neighbours[t][e];
          }
        }
        done[t] = 1;
        from = t;
        t = next;
      }
      if (corners.size() > longest.size())
        longest = corners;
    }
    // Points nearly on one another would ask for tiny elements.
    corners.clear();
    for (const Vector3& x : longest)
      if (corners.empty() || (x - corners.back()).norm() > 1e-2 * scenario.size)
        corners.push_back(x);
    if (corners.size() > 2 && (corners.front() - corners.back()).norm() < 1e-2 * scenario.size)
      corners.pop_back();
  }
  corners.push_back(corners.front());
  return corners;
}

Front front_of(const Scenario& scenario, int increment) {
  const std::vector<Vector2> outline = scenario.outline(increment);
  const std::vector<Vector3> border = border_in_plane(scenario);
  std::vector<Vector2> loop;
  loop.reserve(border.size());
  for (const Vector3& x : border)
    loop.push_back(scenario.in_plane(x));
  const auto within = [&](const Vector2& p) {
    bool in = false;
    for (std::size_t i = 0; i + 1 < loop.size(); ++i)
      if ((loop[i].y() > p.y()) != (loop[i + 1].y() > p.y()) &&
          p.x() <
              loop[i].x() + (p.y() - loop[i].y()) / (loop[i + 1].y() - loop[i].y()) * (loop[i + 1].x() - loop[i].x()))
        in = !in;
    return in;
  };
  const std::size_t n = outline.size();
  Front front;
  if (std::all_of(outline.begin(), outline.end(), within)) {
    front.closed = true;
    for (std::size_t i = 0; i <= n; ++i)
      front.points.push_back(scenario.in_space(outline[i % n]));
    return front;
  }
  // Start outside the organ; one run of the outline is taken to lie inside.
  std::size_t start = 0;
  while (start < n && (within(outline[start]) || !within(outline[(start + 1) % n]))) {
    // An edge may enter and leave again: its crossings tell.
    const Vector2 &a = outline[start], &b = outline[(start + 1) % n];
    int crossings = 0;
    for (std::size_t i = 0; i + 1 < loop.size(); ++i) {
      const Vector2 d = b - a, e = loop[i + 1] - loop[i];
      const double det = cross(d, e);
      if (det == 0)
        continue;
      const double s = cross(loop[i] - a, e) / det, t = cross(loop[i] - a, d) / det;
      crossings += s > 0 && s < 1 && t >= 0 && t < 1 ? 1 : 0;
    }
    if (!within(a) && crossings > 0)
      break;
    ++start;
  }
  for (std::size_t step = 0; step < n; ++step) {
    const Vector2 &a = outline[(start + step) % n], &b = outline[(start + step + 1) % n];
    std::vector<double> crossings;
    for (std::size_t i = 0; i + 1 < loop.size(); ++i) {
      const Vector2 d = b - a, e = loop[i + 1] - loop[i];
      const double det = cross(d, e);
      if (det == 0)
        continue;
      const double s = cross(loop[i] - a, e) / det, t = cross(loop[i] - a, d) / det;
      if (s > 0 && s < 1 && t >= 0 && t < 1)
        crossings.push_back(s);
    }
    std::sort(crossings.begin(), crossings.end());
    for (double s : crossings)
      front.points.push_back(scenario.in_space(a + s * (b - a)));
    if (front.points.size() >= 2 && !within(b))
      break;
    if (within(b))
      front.points.push_back(scenario.in_space(b));
  }
  return front;
}

std::vector<Vector3> leading_edge(const Scenario& scenario, int increment) {
  Front front = front_of(scenario, increment);
  if (front.closed)
    return std::move(front.points);
  const std::vector<Vector2> outline = scenario.outline(increment);
  return {scenario.in_space(outline[1]), scenario.in_space(outline[2])};
}

double distance_to(const std::vector<Vector3>& polyline, const Vector3& x) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < polyline.size(); ++i) {
    const Vector3 along = polyline[i + 1] - polyline[i];
    const double s = std::clamp((x - polyline[i]).dot(along) / along.squaredNorm(), 0.0, 1.0);
    best = std::min(best, (x - polyline[i] - s * along).squaredNorm());
  }
  return std::sqrt(best);
}

double Grading::operator()(const Vector3& x) const {
  return std::clamp(fine + slope * (distance_to(front, x) - 1.5 * fine), fine, coarse);
}

std::vector<FacePoint> face_points(const Scenario& scenario, int increment) {
  std::vector<FacePoint> points;
  const std::vector<Vector2> outline = scenario.outline(increment);
  Vector2 low = outline.front(), high = outline.front();
  for (const Vector2& p : outline) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  if (front_of(scenario, increment).closed) {
    // Round about its middle: r = a sin t gathers points at the front.
    constexpr int rings = 24, sectors = 12;
    const double a = 0.5 * (high.x() - low.x());
    const Vector2 middle = 0.5 * (low + high);
    for (int i = 0; i < rings; ++i)
      for (int j = 0; j < sectors; ++j) {
        const double t = 0.5 * pi * (i + 0.5) / rings, w = 2 * pi * (j + 0.5) / sectors, r = a * std::sin(t);
        points.push_back({scenario.in_space(middle + r * Vector2(std::cos(w), std::sin(w))),
                          r * a * std::cos(t) * (0.5 * pi / rings) * (2 * pi / sectors)});
      }
    return points;
  }
  constexpr int along = 60, across = 30;
  const Vector2 cell = (high - low).cwiseQuotient(Vector2(along, across));
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < across; ++j) {
      const Vector3 x = scenario.in_space(low + cell.cwiseProduct(Vector2(i + 0.5, j + 0.5)));
      // A point at the skin counts by how much of its cell lies inside.
      double share = 0;
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b) {
          const Vector3 y = scenario.in_space(low + cell.cwiseProduct(Vector2(i + (a + 0.5) / 4, j + (b + 0.5) / 4)));
          share += scenario.domain->signed_distance(y) < 0 ? 1.0 / 16 : 0;
        }
      if (share > 0 && scenario.domain->signed_distance(x) < -1e-6 * scenario.size)
        points.push_back({x, share * cell.x() * cell.y()});
    }
  return points;
}

Scenario growing_penny(int increments) {
  Scenario s;
  s.name = "penny";
  const Vector3 half(2, 2, 2);
  s.domain = topology::make_box_domain(-half, half, 0.5);
  s.contains = [domain = s.domain](const Vector3& x) { return domain->signed_distance(x) < 0; };
  s.sharp_edges = box_edges(-half, half);
  s.material = {1, 0.3, 0};
  const CutFrame tilted = tilted_frame({0.03, -0.05, 0.04}, {0.22, -0.17, 0.1});
  s.frame = {tilted.origin, tilted.ahead, tilted.normal, tilted.normal.cross(tilted.ahead)};
  s.increments = increments;
  s.advance = 0.02;
  s.size = 4;
  s.inner = {0.3, 0.1, 0.6};
  const double last = 1;
  // A polygon of the circle's area.
  constexpr int sectors = 40;
  const double scale = std::sqrt(2 * pi / sectors / std::sin(2 * pi / sectors));
  const auto radius = [=, step = s.advance](int k) { return scale * (last - (increments - k) * step); };
  s.outline = [radius](int k) {
    std::vector<Vector2> polygon;
    polygon.reserve(sectors);
    for (int j = 0; j < sectors; ++j)
      polygon.emplace_back(radius(k) * std::cos(2 * pi * j / sectors), radius(k) * std::sin(2 * pi * j / sectors));
    return polygon;
  };
  s.sheet = [radius, frame = s.frame](int k) {
    topology::SurfaceMesh sheet;
    sheet.vertices.push_back(frame.origin);
    constexpr int inner = 2; // rings of the first disc
    for (int ring = 1; ring <= inner + k; ++ring) {
      const double r = ring <= inner ? radius(0) * ring / inner : radius(ring - inner);
      for (int j = 0; j < sectors; ++j)
        sheet.vertices.emplace_back(frame.origin + r * std::cos(2 * pi * j / sectors) * frame.ahead +
                                    r * std::sin(2 * pi * j / sectors) * frame.tangent);
      const int outer = 1 + (ring - 1) * sectors, before = outer - sectors;
      for (int j = 0; j < sectors; ++j) {
        const int next = (j + 1) % sectors;
        if (ring == 1) {
          sheet.triangles.push_back({0, outer + j, outer + next});
          continue;
        }
        sheet.triangles.push_back({before + j, outer + j, outer + next});
        sheet.triangles.push_back({before + j, outer + next, before + next});
      }
    }
    return sheet;
  };
  s.held = [](const Vector3&, const Vector3&) { return true; };
  const CutFrame exact{s.frame.origin, s.frame.ahead, s.frame.normal, s.frame.tangent};
  s.displacement = [exact, material = s.material, last](const Vector3& x) {
    return penny_displacement(material, exact, last, 1, x);
  };
  s.tool = [](const Vector3&) { return false; };
  s.pressure = 1;
  s.marked = s.in_space({0.21, 0.12});
  s.exact_opening = [middle = s.frame.origin, material = s.material, last](const Vector3& x) {
    return penny_opening(material, last, 1, (x - middle).norm());
  };
  s.exact_volume = penny_opening_volume(s.material, last, 1);
  s.exact_marked = penny_opening(s.material, last, 1, (s.marked - s.frame.origin).norm());
  return s;
}

Scenario edge_cut(int increments) {
  Scenario s;
  s.name = "edge";
  const Vector3 lower(-0.03, -0.03, -0.03), upper(0.03, 0.03, 0);
  s.domain = topology::make_box_domain(lower, upper, 0.004);
  s.contains = [domain = s.domain](const Vector3& x) { return domain->signed_distance(x) < 0; };
  s.sharp_edges = box_edges(lower, upper);
  s.material = {5000, 0.4, 1000};
  // Off every axis and cell.
  const Vector3 ahead = Vector3(1, 0.083, 0).normalized();
  s.frame = upright_frame({-0.0317, 0.0013, 0}, ahead, Vector3::UnitZ());
  s.increments = increments;
  s.size = 0.06;
  s.inner = {0.003, 0.009, -0.014};
  s.advance = 0.0008;
  static constexpr double depth = 0.0153, above = 0.004, begin = -0.004, first = 0.0067;
  const auto front = [step = s.advance](int k) { return first + k * step; };
  s.outline = [front](int k) {
    return std::vector<Vector2>{{begin, -depth}, {front(k), -depth}, {front(k), above}, {begin, above}};
  };
  s.sheet = [frame = s.frame, step = s.advance](int k) {
    return columns_sheet(frame, column_places(begin, first, step, k), -depth, above, 0.005);
  };
  s.held = [](const Vector3& x, const Vector3& n) { return std::abs(n.y()) > 0.9 && std::abs(x.y()) > 0.0299; };
  s.displacement = [](const Vector3& x) -> Vector3 { return {0, x.y() > 0 ? 0.0005 : -0.0005, 0}; };
  s.tool = [](const Vector3& x) { return x.y() > 0; };
  s.force_direction = Vector3::UnitY();
  s.marked = s.in_space({0.5 * first, -0.3 * depth});
  return s;
}

Scenario liver_incision(int increments) {
  Scenario s;
  s.name = "liver";
  s.domain = topology::make_organ_domain(topology::make_liver(5000));
  s.contains = side_of_organ(s.domain, 0.001);
  s.material = {6000, 0.4, 1000};
  s.increments = increments;
  const BoundingBox box = s.domain->bounds();
  s.size = box.extent().norm();
  // On the dome of the right lobe; the cut runs along x, 20 mm deep.
  const Vector3 top = s.domain->closest_surface_point({-0.045, 0.003, box.upper.z() + 0.02});
  const Vector3 ahead = Vector3(1, 0.11, 0.03).normalized();
  const Vector3 up = (Vector3::UnitZ() - ahead.z() * ahead).normalized();
  s.frame = upright_frame(top - 0.02 * ahead, ahead, up);
  s.inner = top - 0.035 * up + 0.004 * s.frame.normal;
  s.advance = 0.001;
  static constexpr double depth = 0.02, above = 0.03, first = 0.012;
  const auto front = [step = s.advance](int k) { return first + k * step; };
  s.outline = [front](int k) {
    return std::vector<Vector2>{{0, -depth}, {front(k), -depth}, {front(k), above}, {0, above}};
  };
  s.sheet = [frame = s.frame, step = s.advance](int k) {
    return columns_sheet(frame, column_places(0, first, step, k), -depth, above, 0.008);
  };
  // Spread by a pressure on its faces: pads that hold the skin would be met otherwise by every mesh.
  const double low = box.lower.z() + 0.3 * box.extent().z();
  s.held = [low](const Vector3& x, const Vector3&) { return x.z() < low; };
  s.displacement = [](const Vector3&) -> Vector3 { return Vector3::Zero(); };
  s.tool = [](const Vector3&) { return false; };
  s.pressure = 300;
  s.marked = s.in_space({0.5 * first, -0.004});
  return s;
}

} // namespace spherecut::experiments::ledger
