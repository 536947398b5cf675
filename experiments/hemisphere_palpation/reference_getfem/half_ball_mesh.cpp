// Meridian plane (r, z), three blocks that meet in P = (0.38, 0.38):
//
//    pole
//     |****..  45 deg        top    s across (0 axis, 1 right edge), w up (0 middle block, 1 surface)
//     | top  / *             middle s across, t up (0 base, 1 top)
//     |-----P    *           side   w across (0 middle block, 1 surface), t up
//     | mid | side*
//     +-----+------*  rim
//
// Revolved about the axis, top and middle become a stack of discs of radius s: a square block about the axis and a ring
// around it (an O-grid), so that no element touches the axis with a collapsed edge.
#include "experiments/hemisphere_palpation/reference_getfem/half_ball_mesh.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <numbers>

namespace spherecut::experiments {

namespace {

using Vector2 = Eigen::Vector2d;
using Map = std::function<Vector3(double, double, double)>;

constexpr double eighth_turn = std::numbers::pi / 4;
constexpr double middle_width = 0.45, middle_corner = 0.38;

Vector2 on_arc(double angle) {
  return {std::sin(angle), std::cos(angle)};
}

Vector2 middle_block(double s, double t) {
  return {s * std::lerp(middle_width, middle_corner, t), t * std::lerp(middle_width, middle_corner, s * s)};
}
Vector2 top_block(double s, double w) {
  return (1 - w) * middle_block(s, 1) + w * on_arc(s * eighth_turn);
}
Vector2 side_block(double w, double t) {
  return (1 - w) * middle_block(1, t) + w * on_arc((2 - t) * eighth_turn);
}

/// Turns a meridian point about the axis to the direction of (x, y); on the axis the direction does not matter.
Vector3 turned(const Vector2& meridian, const Vector2& direction) {
  const double length = direction.norm();
  if (length == 0)
    return {0, 0, meridian.y()};
  return {meridian.x() * direction.x() / length, meridian.x() * direction.y() / length, meridian.y()};
}

/// n + 1 ascending values between `dense` and `coarse`, growing like k^exponent away from `dense`.
std::vector<double> graded(double dense, double coarse, int n, double exponent) {
  std::vector<double> values;
  for (int k = 0; k <= n; ++k)
    values.push_back(dense + (coarse - dense) * std::pow(static_cast<double>(k) / n, exponent));
  if (dense > coarse)
    return {values.rbegin(), values.rend()};
  return values;
}

/// A block of bricks with element corners at the given parameters.
void add_block(std::vector<Brick>& bricks, const std::vector<double>& a, const std::vector<double>& b,
               const std::vector<double>& c, const Map& map) {
  const auto at = [](const std::vector<double>& v, std::size_t i, std::size_t half) {
    return v[i] + 0.5 * static_cast<double>(half) * (v[i + 1] - v[i]);
  };
  for (std::size_t k = 0; k + 1 < c.size(); ++k)
    for (std::size_t j = 0; j + 1 < b.size(); ++j)
      for (std::size_t i = 0; i + 1 < a.size(); ++i) {
        Brick brick;
        for (std::size_t n = 0; n < 27; ++n)
          brick[n] = map(at(a, i, n % 3), at(b, j, n / 3 % 3), at(c, k, n / 9));
        bricks.push_back(brick);
      }
}

struct Lines {
  std::vector<double> core, turn, cap, free, depth, height;
};

/// Blocks of a disc of radius 1 in (x, y), extruded by `meridian(s, level)` over the given levels.
void add_discs(std::vector<Brick>& bricks, const Lines& lines, double cap_edge, const std::vector<double>& levels,
               const std::function<Vector2(double, double)>& meridian) {
  const double side = 0.4 * cap_edge, corner = 0.32 * cap_edge;
  const auto place = [&](const Vector2& x, double level) { return turned(meridian(x.norm(), level), x); };
  const auto square = [=](double a, double b) {
    return Vector2(a * std::lerp(side, corner, b), b * std::lerp(side, corner, a));
  };
  add_block(bricks, lines.core, lines.core, levels,
            [&](double a, double b, double level) { return place(square(a, b), level); });
  // Ring coordinates: v outwards from the square (0) to the edge of the cap (1); turn from the x axis (0) over the
  // corner of the square (1) to the y axis (2).
  const auto circle = [](double turn) { return Vector2(std::cos(turn * eighth_turn), std::sin(turn * eighth_turn)); };
  add_block(bricks, lines.cap, lines.turn, levels, [&](double v, double turn, double level) {
    const Vector2 inner = turn <= 1 ? square(1, turn) : square(2 - turn, 1);
    return place((1 - v) * inner + v * cap_edge * circle(turn), level);
  });
  add_block(bricks, lines.free, lines.turn, levels,
            [&](double s, double turn, double level) { return place(s * circle(turn), level); });
}

struct Quadratic {
  explicit Quadratic(double x)
      : value{0.5 * x * (x - 1), 1 - x * x, 0.5 * x * (x + 1)}, slope{x - 0.5, -2 * x, x + 0.5} {}
  std::array<double, 3> value, slope;
};

} // namespace

std::vector<Brick> half_ball_mesh(const HalfBallResolution& resolution, double cap_radius) {
  const double cap_edge = std::asin(cap_radius) / eighth_turn;
  const Lines lines{graded(0, 1, resolution.core, 1),  graded(0, 2, 2 * resolution.core, 1),
                    graded(1, 0, resolution.cap, 4),   graded(cap_edge, 1, resolution.free, 4),
                    graded(1, 0, resolution.depth, 4), graded(0, 1, resolution.middle, 2)};
  std::vector<Brick> bricks;
  add_discs(bricks, lines, cap_edge, lines.height, middle_block);
  add_discs(bricks, lines, cap_edge, lines.depth, top_block);
  add_block(bricks, lines.depth, lines.turn, lines.height, [](double w, double turn, double t) {
    return turned(side_block(w, t), Vector2(std::cos(turn * eighth_turn), std::sin(turn * eighth_turn)));
  });
  return bricks;
}

double checked_volume(const std::vector<Brick>& bricks) {
  const std::array points{-std::sqrt(0.6), 0.0, std::sqrt(0.6)}, weights{5.0 / 9, 8.0 / 9, 5.0 / 9};
  double volume = 0;
  for (std::size_t e = 0; e < bricks.size(); ++e)
    for (int g = 0; g < 27; ++g) {
      const std::array<Quadratic, 3> q{Quadratic(points[g % 3]), Quadratic(points[g / 3 % 3]),
                                       Quadratic(points[g / 9])};
      Matrix3 jacobian = Matrix3::Zero();
      for (int n = 0; n < 27; ++n) {
        const std::array<int, 3> i{n % 3, n / 3 % 3, n / 9};
        for (int d = 0; d < 3; ++d) {
          double slope = 1;
          for (int c = 0; c < 3; ++c)
            slope *= c == d ? q[c].slope[i[c]] : q[c].value[i[c]];
          jacobian.col(d) += slope * bricks[e][n];
        }
      }
      const double determinant = jacobian.determinant();
      if (!(determinant > 0))
        throw NumericalError(
            fmt::format("half ball: brick {} has Jacobian {} at Gauss point {} (must be positive)", e, determinant, g));
      volume += determinant * weights[g % 3] * weights[g / 3 % 3] * weights[g / 9];
    }
  return volume;
}

} // namespace spherecut::experiments
