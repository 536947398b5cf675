// Key: L barycentric coordinates, (x, y) ahead of the front and over the plane, r, t polar about the front.
#include "experiments/remeshing_ledger/xfem_cells.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace spherecut::experiments::ledger {

namespace {

constexpr std::array<std::array<int, 2>, 6> cell_edges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

double plane_cross(const Vector2& a, const Vector2& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// The part of a convex polygon to the left of a line.
std::vector<Vector2> left_of(const std::vector<Vector2>& polygon, const Vector2& from, const Vector2& to) {
  std::vector<Vector2> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector2 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double da = plane_cross(to - from, a - from), db = plane_cross(to - from, b - from);
    if (da >= 0)
      kept.push_back(a);
    if ((da < 0) != (db < 0))
      kept.emplace_back(a + da / (da - db) * (b - a));
  }
  return kept;
}

struct PlanePoint {
  double l0, l1, l2, weight;
};
/// Six points, exact to degree 4 [Dunavant 1985].
constexpr double a1 = 0.445948490915965, w1 = 0.223381589678011, a2 = 0.091576213509771, w2 = 0.109951743655322;
constexpr std::array<PlanePoint, 6> plane_points{{{1 - 2 * a1, a1, a1, w1},
                                                  {a1, 1 - 2 * a1, a1, w1},
                                                  {a1, a1, 1 - 2 * a1, w1},
                                                  {1 - 2 * a2, a2, a2, w2},
                                                  {a2, 1 - 2 * a2, a2, w2},
                                                  {a2, a2, 1 - 2 * a2, w2}}};

} // namespace

FrontDistance::FrontDistance(const Scenario& scenario, int increment) : scenario_(&scenario) {
  const Front front = front_of(scenario, increment);
  closed_ = front.closed;
  for (const Vector3& x : front.points)
    points_.push_back(scenario.in_plane(x));
}

FrontDistance::Place FrontDistance::at(const Vector3& x) const {
  const Vector2 p = scenario_->in_plane(x);
  double least = std::numeric_limits<double>::infinity(), ahead = 0;
  Vector2 way = Vector2::Zero();
  for (std::size_t i = 0; i + 1 < points_.size(); ++i) {
    // The ends of a front at the skin reach on beyond it.
    const Vector2 along = points_[i + 1] - points_[i];
    double s = (p - points_[i]).dot(along) / along.squaredNorm();
    if (closed_ || i > 0)
      s = std::max(s, 0.0);
    if (closed_ || i + 2 < points_.size())
      s = std::min(s, 1.0);
    const Vector2 apart = p - points_[i] - s * along;
    const double distance = apart.squaredNorm();
    if (distance >= least)
      continue;
    least = distance;
    const Vector2 outward = Vector2(along.y(), -along.x()).normalized();
    if ((s > 0 && s < 1) || distance == 0) {
      ahead = apart.dot(outward);
      way = outward;
    } else {
      ahead = std::copysign(std::sqrt(distance), apart.dot(outward));
      way = apart / ahead;
    }
  }
  return {ahead, scenario_->height(x), way.x() * scenario_->frame.ahead + way.y() * scenario_->frame.tangent};
}

FrontFunctions front_values(const FrontDistance::Place& place, const Vector3& normal) {
  const double x = place.ahead, y = place.height;
  const double r = std::max(std::hypot(x, y), 1e-300), t = std::atan2(y, x), root = std::sqrt(r);
  const double s = std::sin(0.5 * t), c = std::cos(0.5 * t), st = y / r, ct = x / r;
  const std::array<double, 4> angular{s, c, s * st, c * st};
  const std::array<double, 4> turned{0.5 * c, -0.5 * s, 0.5 * c * st + s * ct, -0.5 * s * st + c * ct};
  FrontFunctions f;
  for (std::size_t k = 0; k < 4; ++k) {
    f.value[k] = root * angular[k];
    const double by_r = 0.5 * angular[k] / root, by_t = turned[k] / root; // the latter over r
    f.gradient[k] = (by_r * ct - by_t * st) * place.way + (by_r * st + by_t * ct) * normal;
  }
  return f;
}

StraightCell::StraightCell(const FemNodes& nodes, int element) : quadratic_(nodes.element != Element::linear) {
  for (std::size_t k = 0; k < 4; ++k)
    corner_[k] = nodes.positions[nodes.elements[element][k]];
  Matrix3 edges;
  for (int k = 0; k < 3; ++k)
    edges.col(k) = corner_[static_cast<std::size_t>(k) + 1] - corner_[0];
  volume_ = edges.determinant() / 6;
  flat_.rightCols<3>() = edges.inverse().transpose();
  flat_.col(0) = -flat_.rightCols<3>().rowwise().sum();
}

ShapeValues StraightCell::at(const std::array<double, 4>& l) const {
  ShapeValues s;
  if (!quadratic_) {
    std::copy(l.begin(), l.end(), s.value.begin());
    s.gradient.leftCols<4>() = flat_;
    return s;
  }
  for (int k = 0; k < 4; ++k) {
    s.value[k] = l[k] * (2 * l[k] - 1);
    s.gradient.col(k) = (4 * l[k] - 1) * flat_.col(k);
  }
  for (int k = 0; k < 6; ++k) {
    const auto [a, b] = cell_edges[k];
    s.value[4 + k] = 4 * l[a] * l[b];
    s.gradient.col(4 + k) = 4 * (l[a] * flat_.col(b) + l[b] * flat_.col(a));
  }
  return s;
}

Vector3 StraightCell::position(const std::array<double, 4>& l) const {
  return l[0] * corner_[0] + l[1] * corner_[1] + l[2] * corner_[2] + l[3] * corner_[3];
}

std::array<double, 4> StraightCell::place(const Vector3& x) const {
  std::array<double, 4> l{};
  l[0] = 1;
  for (int k = 1; k < 4; ++k) {
    l[k] = flat_.col(k).dot(x - corner_[0]);
    l[0] -= l[k];
  }
  return l;
}

MatrixX enriched_stiffness(const StraightCell& cell, const std::vector<CellFunction>& functions, const CellRule& rule,
                           const FrontDistance& front, const Scenario& scenario) {
  const Eigen::Index count = std::ssize(functions), points = std::ssize(rule.weight);
  const bool at_front = std::any_of(functions.begin(), functions.end(), [](const auto& f) { return f.front >= 0; });
  std::array<MatrixX, 3> g;
  for (MatrixX& m : g)
    m.resize(points, count);
  for (Eigen::Index q = 0; q < points; ++q) {
    const auto& l = rule.place[static_cast<std::size_t>(q)];
    const double root = std::sqrt(rule.weight[static_cast<std::size_t>(q)]);
    const ShapeValues shape = cell.at(l);
    const Vector3 x = cell.position(l);
    const double height = scenario.height(x);
    FrontFunctions enriched;
    Eigen::Matrix<double, 3, 4> flat;
    if (at_front) {
      enriched = front_values(front.at(x), scenario.frame.normal);
      flat = cell.flat();
    }
    for (Eigen::Index f = 0; f < count; ++f) {
      const CellFunction& function = functions[static_cast<std::size_t>(f)];
      Vector3 gradient = Vector3::Zero();
      if (function.front >= 0) {
        const auto k = static_cast<std::size_t>(function.front);
        gradient = enriched.value[k] * flat.col(function.base) +
                   l[static_cast<std::size_t>(function.base)] * enriched.gradient[k];
      } else if (function.side == 0 || (function.side > 0) == (height > 0)) {
        gradient = shape.gradient.col(function.base);
      }
      for (int d = 0; d < 3; ++d)
        g[static_cast<std::size_t>(d)](q, f) = root * gradient[d];
    }
  }
  std::array<std::array<MatrixX, 3>, 3> sum;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = a; b < 3; ++b) {
      sum[a][b].noalias() = g[a].transpose() * g[b];
      if (b != a)
        sum[b][a] = sum[a][b].transpose();
    }
  const double lambda = scenario.material.lame_lambda(), mu = scenario.material.shear_modulus();
  MatrixX stiffness(3 * count, 3 * count);
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index j = 0; j < count; ++j) {
      const double trace = mu * (sum[0][0](i, j) + sum[1][1](i, j) + sum[2][2](i, j));
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          stiffness(3 * i + a, 3 * j + b) = lambda * sum[a][b](i, j) + mu * sum[b][a](i, j) + (a == b ? trace : 0);
    }
  return stiffness;
}

std::vector<Vector3> crossings(const StraightCell& cell, const Scenario& scenario) {
  std::vector<Vector3> points;
  std::array<double, 4> height;
  for (std::size_t k = 0; k < 4; ++k)
    height[k] = scenario.height(cell.corner(k));
  for (const auto& [a, b] : cell_edges)
    if ((height[a] < 0) != (height[b] < 0))
      points.emplace_back(cell.corner(a) + height[a] / (height[a] - height[b]) * (cell.corner(b) - cell.corner(a)));
  if (points.size() < 3)
    return {};
  Vector2 middle = Vector2::Zero();
  for (const Vector3& x : points)
    middle += scenario.in_plane(x) / static_cast<double>(points.size());
  std::sort(points.begin(), points.end(), [&](const Vector3& a, const Vector3& b) {
    const Vector2 p = scenario.in_plane(a) - middle, q = scenario.in_plane(b) - middle;
    return std::atan2(p.y(), p.x()) < std::atan2(q.y(), q.x());
  });
  return points;
}

std::vector<CutPoint> cut_points(const StraightCell& cell, const Scenario& scenario,
                                 const std::vector<Vector2>& outline, CellState state) {
  std::vector<CutPoint> points;
  std::vector<Vector2> polygon;
  for (const Vector3& x : crossings(cell, scenario))
    polygon.push_back(scenario.in_plane(x));
  if (state == CellState::front)
    for (std::size_t i = 0; i < outline.size() && !polygon.empty(); ++i)
      polygon = left_of(polygon, outline[i], outline[(i + 1) % outline.size()]);
  const int parts = state == CellState::front ? 4 : 1; // a side of a triangle
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    const Vector2 u = (polygon[i] - polygon[0]) / parts, v = (polygon[i + 1] - polygon[0]) / parts;
    const double area = 0.5 * plane_cross(u, v);
    for (int a = 0; a < parts; ++a)
      for (int b = 0; a + b < parts; ++b)
        for (int turned = 0; turned < (a + b + 1 < parts ? 2 : 1); ++turned)
          for (const PlanePoint& p : plane_points) {
            const double s = turned != 0 ? a + 1 - p.l1 : a + p.l1, t = turned != 0 ? b + 1 - p.l2 : b + p.l2;
            points.push_back({cell.place(scenario.in_space(polygon[0] + s * u + t * v)), area * p.weight});
          }
  }
  return points;
}

VectorX jumps(const StraightCell& cell, const std::vector<CellFunction>& functions, const std::array<double, 4>& place,
              const FrontDistance& front) {
  const ShapeValues shape = cell.at(place);
  const double behind = std::max(-front.at(cell.position(place)).ahead, 0.0);
  VectorX jump(std::ssize(functions));
  for (std::size_t f = 0; f < functions.size(); ++f) {
    const CellFunction& function = functions[f];
    jump[static_cast<Eigen::Index>(f)] =
        function.front < 0    ? function.side * shape.value[static_cast<std::size_t>(function.base)]
        : function.front == 0 ? 2 * std::sqrt(behind) * place[static_cast<std::size_t>(function.base)]
                              : 0;
  }
  return jump;
}

} // namespace spherecut::experiments::ledger
