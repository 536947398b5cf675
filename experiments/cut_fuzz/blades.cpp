#include "experiments/cut_fuzz/blades.hpp"

#include "topology/blade/blade.hpp"
#include "topology/organ/organs.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <numbers>

namespace spherecut::experiments {

namespace {

using topology::SurfaceMesh;

/// Random numbers that are alike with every standard library.
class Dice {
 public:
  explicit Dice(std::mt19937_64& random) : random_(random) {}
  double between(double lower, double upper) {
    return lower + (upper - lower) * 0x1p-53 * static_cast<double>(random_() >> 11);
  }
  int below(int count) { return static_cast<int>(random_() % static_cast<std::uint64_t>(count)); }
  Vector3 direction() {
    for (;;) {
      const Vector3 x(between(-1, 1), between(-1, 1), between(-1, 1));
      if (x.squaredNorm() < 1 && x.squaredNorm() > 0.01)
        return x.normalized();
    }
  }
  Vector3 perpendicular(const Vector3& normal) { return normal.cross(direction()).stableNormalized(); }

 private:
  std::mt19937_64& random_;
};

Vector3 on_surface(const SurfaceMesh& organ, Dice& dice) {
  const Triangle& t = organ.triangles[dice.below(static_cast<int>(organ.triangles.size()))];
  const double a = dice.between(0, 1), b = dice.between(0, 1 - a);
  return (1 - a - b) * organ.vertices[t[0]] + a * organ.vertices[t[1]] + b * organ.vertices[t[2]];
}

double size_of(const SurfaceMesh& organ) {
  return topology::bounds(organ).extent().norm();
}

SurfaceMesh grid(int columns, int rows, const std::function<Vector3(double, double)>& place) {
  SurfaceMesh sheet;
  for (int i = 0; i <= columns; ++i)
    for (int j = 0; j <= rows; ++j)
      sheet.vertices.push_back(place(double(i) / columns, double(j) / rows));
  const auto at = [rows](int i, int j) { return i * (rows + 1) + j; };
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      sheet.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      sheet.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return sheet;
}

SurfaceMesh parallelogram(const Vector3& middle, const Vector3& first, const Vector3& second, int columns, int rows) {
  return grid(columns, rows,
              [&](double s, double t) -> Vector3 { return middle + (s - 0.5) * first + (t - 0.5) * second; });
}

SurfaceMesh flat(const Vector3& middle, const Vector3& normal, double width, double height, Dice& dice) {
  const Vector3 along = dice.perpendicular(normal);
  return parallelogram(middle, width * along, height * normal.cross(along), 1 + dice.below(8), 1 + dice.below(8));
}

/// One sheet laid down in up to four stages.
std::vector<std::vector<SurfaceMesh>> grown(const SurfaceMesh& sheet, Dice& dice) {
  std::vector<std::vector<SurfaceMesh>> stages;
  const int count = 1 + dice.below(4), triangles = static_cast<int>(sheet.triangles.size());
  for (int stage = 1; stage <= count; ++stage) {
    SurfaceMesh part = sheet;
    part.triangles.resize(std::max(1, triangles * stage / count));
    stages.push_back({part});
  }
  return stages;
}

/// All sheets, one after the other.
std::vector<std::vector<SurfaceMesh>> one_by_one(const std::vector<SurfaceMesh>& sheets) {
  std::vector<std::vector<SurfaceMesh>> stages;
  for (std::size_t count = 1; count <= sheets.size(); ++count)
    stages.emplace_back(sheets.begin(), sheets.begin() + static_cast<std::ptrdiff_t>(count));
  return stages;
}

FuzzCut swept(const FuzzOrgan& organ, Dice& dice) {
  const double size = size_of(organ.surface);
  topology::Blade blade;
  const int points = 2 + dice.below(3);
  for (int k = 0; k < points; ++k)
    blade.edge.emplace_back(0.02 * size * dice.between(-1, 1), 0, size * dice.between(0.05, 0.12) * (k + 1));
  topology::SweepOptions options;
  options.edge = size * dice.between(0.02, 0.06);
  topology::BladeSweep sweep(blade, organ.domain, options);
  topology::BladePose pose;
  pose.position = on_surface(organ.surface, dice) - 0.15 * size * dice.direction();
  pose.orientation = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), dice.direction());
  sweep.move_to(pose);
  FuzzCut cut{"swept", {}};
  Vector3 heading = dice.direction();
  const int moves = 2 + dice.below(5);
  for (int k = 0; k < moves; ++k) {
    pose.time += 1;
    const int manner = dice.below(8);
    if (manner == 0) { // back along its own path
      heading = -heading;
    } else if (manner == 1) { // the edge's own direction
      heading = pose.orientation * Vector3::UnitZ();
    } else {
      heading = (heading + 0.5 * dice.direction()).stableNormalized();
    }
    if (manner != 2) // else: no step
      pose.position += size * dice.between(0.01, 0.12) * heading;
    pose.orientation = pose.orientation * Eigen::AngleAxisd(dice.between(-0.2, 0.2), dice.direction());
    if (manner == 3)
      sweep.lift();
    sweep.move_to(pose);
    cut.stages.push_back(sweep.sheets());
  }
  return cut;
}

FuzzCut random_flat(const FuzzOrgan& organ, Dice& dice) {
  const double size = size_of(organ.surface);
  return {"flat", grown(flat(on_surface(organ.surface, dice), dice.direction(), size * dice.between(0.02, 1.5),
                             size * dice.between(0.02, 1.5), dice),
                        dice)};
}

FuzzCut waved(const FuzzOrgan& organ, Dice& dice) {
  const double size = size_of(organ.surface), width = size * dice.between(0.1, 0.7),
               height = size * dice.between(0.1, 0.7);
  const double amplitude = size * dice.between(0.005, 0.05), waves = dice.between(1, 9);
  const Vector3 normal = dice.direction(), along = dice.perpendicular(normal), across = normal.cross(along);
  const Vector3 middle = on_surface(organ.surface, dice);
  return {"waved", grown(grid(4 + dice.below(20), 4 + dice.below(10),
                              [&](double s, double t) -> Vector3 {
                                return middle + (s - 0.5) * width * along + (t - 0.5) * height * across +
                                       amplitude * std::sin(waves * s + 3 * t) * normal;
                              }),
                         dice)};
}

FuzzCut spiral(const FuzzOrgan& organ, Dice& dice) {
  // Comes back through its own path.
  const double size = size_of(organ.surface), radius = size * dice.between(0.03, 0.15), turns = dice.between(0.8, 2);
  const double shrink = dice.between(0, 0.6), drift = dice.between(-0.5, 0.5), height = size * dice.between(0.05, 0.6);
  const Vector3 axis = dice.direction(), along = dice.perpendicular(axis), across = axis.cross(along);
  const Vector3 middle = on_surface(organ.surface, dice);
  return {"self-crossing", grown(grid(10 + dice.below(30), 2 + dice.below(5),
                                      [&](double s, double t) -> Vector3 {
                                        const double angle = 2 * std::numbers::pi * turns * s;
                                        const double r = radius * (1 - shrink * s);
                                        return middle + (r * std::cos(angle) + drift * radius * s) * along +
                                               r * std::sin(angle) * across + (t - 0.5) * height * axis;
                                      }),
                                 dice)};
}

FuzzCut crossing(const FuzzOrgan& organ, Dice& dice) {
  const double size = size_of(organ.surface);
  const Vector3 middle = on_surface(organ.surface, dice);
  std::vector<SurfaceMesh> sheets;
  for (int count = 2 + dice.below(3); count > 0; --count)
    sheets.push_back(flat(middle + 0.05 * size * dice.between(0, 1) * dice.direction(), dice.direction(),
                          size * dice.between(0.1, 1.2), size * dice.between(0.1, 1.2), dice));
  return {"crossing", one_by_one(sheets)};
}

FuzzCut through_vertices(const FuzzOrgan& organ, Dice& dice) {
  // All corners are vertices of the organ: a strip of triangles over them.
  const std::vector<Vector3>& x = organ.surface.vertices;
  SurfaceMesh sheet;
  const int first = dice.below(static_cast<int>(x.size()));
  for (int k = 0; k < 3 + dice.below(5); ++k)
    sheet.vertices.push_back(x[dice.below(3) == 0 ? dice.below(static_cast<int>(x.size()))
                                                  : (first + dice.below(40)) % static_cast<int>(x.size())]);
  for (int k = 0; k + 2 < std::ssize(sheet.vertices); ++k)
    sheet.triangles.push_back(k % 2 == 0 ? Triangle{k, k + 1, k + 2} : Triangle{k + 1, k, k + 2});
  return {"through vertices", grown(sheet, dice)};
}

FuzzCut along_edge(const FuzzOrgan& organ, Dice& dice) {
  // A plane that contains an edge of the organ, whole or as part of a side.
  const Triangle& t = organ.surface.triangles[dice.below(static_cast<int>(organ.surface.triangles.size()))];
  const Vector3 &a = organ.surface.vertices[t[0]], &b = organ.surface.vertices[t[1]];
  const Vector3 down = size_of(organ.surface) * dice.between(0.01, 0.8) * dice.direction();
  SurfaceMesh sheet;
  const double up = dice.below(2) == 0 ? 0 : 1;
  sheet.vertices = {a - up * down, b - up * down, a, b, a + down, b + down};
  sheet.triangles = {{0, 1, 2}, {1, 3, 2}, {2, 3, 4}, {3, 5, 4}};
  return {"along an edge", grown(sheet, dice)};
}

FuzzCut coplanar(const FuzzOrgan& organ, Dice& dice) {
  // In the plane of one triangle, exactly where its corners are concerned; or a piece of the surface itself.
  const int count = static_cast<int>(organ.surface.triangles.size());
  const int chosen = dice.below(count);
  SurfaceMesh sheet;
  if (dice.below(2) == 0) {
    sheet.vertices = organ.surface.vertices;
    for (int k = 0; k < 1 + dice.below(30); ++k)
      sheet.triangles.push_back(organ.surface.triangles[(chosen + k) % count]);
    topology::SurfaceMesh used; // corners of its own for every triangle
    for (const Triangle& t : sheet.triangles) {
      const int at = static_cast<int>(used.vertices.size());
      for (const int v : t)
        used.vertices.push_back(sheet.vertices[v]);
      used.triangles.push_back({at, at + 1, at + 2});
    }
    sheet = used;
  } else {
    const Triangle& t = organ.surface.triangles[chosen];
    const Vector3 &a = organ.surface.vertices[t[0]], &b = organ.surface.vertices[t[1]],
                  &c = organ.surface.vertices[t[2]];
    const double stretch = dice.between(0.5, 20);
    sheet = parallelogram(a, stretch * (b - a), stretch * (c - a), 1 + dice.below(3), 1 + dice.below(3));
  }
  return {"coplanar with the surface", grown(sheet, dice)};
}

FuzzCut grazing(const FuzzOrgan& organ, Dice& dice) {
  // Tangent plane at a vertex or a triangle, a hair inside or outside.
  const int triangle = dice.below(static_cast<int>(organ.surface.triangles.size()));
  const Vector3 normal = topology::triangle_normal(organ.surface, triangle);
  const Vector3& at = organ.surface.vertices[organ.surface.triangles[triangle][0]];
  constexpr std::array<double, 7> depths = {0, 1e-16, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3};
  const double size = size_of(organ.surface);
  const double depth = size * depths[dice.below(static_cast<int>(depths.size()))] * (dice.below(2) == 0 ? 1 : -1);
  return {
      "grazing",
      grown(flat(at + depth * normal, normal, size * dice.between(0.02, 1), size * dice.between(0.02, 1), dice), dice)};
}

FuzzCut again(const FuzzOrgan& organ, Dice& dice) {
  // The same plane twice: the same triangles, other steps, or a hair off.
  const double size = size_of(organ.surface);
  const Vector3 normal = dice.below(3) == 0 ? Vector3(Vector3::Unit(dice.below(3))) : dice.direction();
  const Vector3 along = dice.perpendicular(normal), across = normal.cross(along);
  const double width = size * dice.between(0.1, 1), height = size * dice.between(0.1, 1);
  const Vector3 middle = on_surface(organ.surface, dice);
  const SurfaceMesh first = parallelogram(middle, width * along, height * across, 4, 4);
  SurfaceMesh second = first;
  const int manner = dice.below(4);
  if (manner == 1)
    for (Triangle& t : second.triangles)
      std::swap(t[0], t[1]);
  if (manner == 2)
    second = parallelogram(middle + 0.25 * width * along, width * along, height * across, 4, 4);
  if (manner == 3)
    for (Vector3& x : second.vertices)
      x += size * 1e-15 * dice.direction();
  return {"again in place", one_by_one({first, second})};
}

FuzzCut on_lattice(const FuzzOrgan& organ, Dice& dice) {
  // Axis-parallel planes through vertices of the organ, with corners at coordinates of others.
  const std::vector<Vector3>& x = organ.surface.vertices;
  const auto any = [&] { return x[dice.below(static_cast<int>(x.size()))]; };
  std::vector<SurfaceMesh> sheets;
  for (int count = 1 + dice.below(3); count > 0; --count) {
    const int axis = dice.below(3), u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double level = any()[axis];
    SurfaceMesh sheet;
    const Vector3 a = any(), b = any();
    for (int k = 0; k < 4; ++k) {
      Vector3 corner;
      corner[axis] = level;
      corner[u] = k % 2 == 0 ? a[u] : b[u];
      corner[v] = k < 2 ? a[v] : b[v];
      sheet.vertices.push_back(corner);
    }
    sheet.triangles = {{0, 1, 3}, {0, 3, 2}};
    sheets.push_back(sheet);
  }
  return {"on the lattice", one_by_one(sheets)};
}

FuzzCut closed(const FuzzOrgan& organ, Dice& dice) {
  const double size = size_of(organ.surface);
  const Vector3 scale = size * Vector3(dice.between(0.02, 0.2), dice.between(0.02, 0.2), dice.between(0.02, 0.2));
  SurfaceMesh sheet = dice.below(2) == 0 ? topology::make_block(scale, scale.maxCoeff() / 3)
                                         : topology::make_hemisphere(scale.x(), scale.x() / 3);
  const Vector3 inside = organ.domain->bounds().centre(), at = on_surface(organ.surface, dice);
  const Vector3 middle = at + dice.between(0, 1) * (inside - at);
  const Eigen::AngleAxisd turn(dice.below(3) == 0 ? 0 : dice.between(0, 3), dice.direction());
  for (Vector3& x : sheet.vertices)
    x = middle + turn * x;
  return {"closed", grown(sheet, dice)};
}

FuzzCut needles(const FuzzOrgan& organ, Dice& dice) {
  // Loose thin triangles, some without area, that share corners at random.
  const double size = size_of(organ.surface);
  SurfaceMesh sheet;
  for (int k = 0; k < 6; ++k)
    sheet.vertices.push_back(on_surface(organ.surface, dice));
  for (int k = 0; k < 4; ++k) {
    const Vector3 a = sheet.vertices[dice.below(6)], b = sheet.vertices[dice.below(6)];
    sheet.vertices.push_back(0.5 * (a + b) + size * std::pow(10, dice.between(-17, -2)) * dice.direction());
  }
  const int count = static_cast<int>(sheet.vertices.size());
  for (int k = 0; k < 8; ++k)
    sheet.triangles.push_back({dice.below(count), dice.below(count), dice.below(count)});
  return {"needles", grown(sheet, dice)};
}

using Maker = FuzzCut (*)(const FuzzOrgan&, Dice&);
constexpr std::array<Maker, 14> makers = {swept, random_flat,      waved,      spiral,   crossing,
                                          swept, through_vertices, along_edge, coplanar, grazing,
                                          again, on_lattice,       closed,     needles};

} // namespace

int fuzz_kind_count() {
  return static_cast<int>(makers.size());
}

FuzzCut make_fuzz_cut(const FuzzOrgan& organ, int kind, std::mt19937_64& random) {
  Dice dice(random);
  return makers.at(kind)(organ, dice);
}

FuzzCut make_fuzz_cut(const FuzzOrgan& organ, int number) {
  std::mt19937_64 random(static_cast<std::uint64_t>(number) * 0x9E3779B97F4A7C15ULL + 1);
  random.discard(8);
  return make_fuzz_cut(organ, number % fuzz_kind_count(), random);
}

} // namespace spherecut::experiments
