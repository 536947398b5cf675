// Key: a patch is a part of the surface on one side of a gap, without sharp edges; its wall is the patch with every
// vertex moved half way across, and strips along its border.
#include "topology/incision/gap_walls.hpp"

#include "topology/search/point_tree.hpp"
#include "topology/surface/widths.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace spherecut::topology {

namespace {

constexpr double out_of_gap = 3;      // spacings: spheres that have grown reach no farther
constexpr double longest_edge = 0.5;  // of a wall, in spacings
constexpr double into_bottom = 1e-3;  // spacings
constexpr double blunt = 0.6;         // spacings: the bottom of a wider gap is no front of a crack
constexpr double inwards = 0.02;      // of the way to the middle of its triangles: a ray from a corner starts there
constexpr double sharp_cosine = 0.77; // of 40 degrees
constexpr double known_share = 0.5;   // of a patch: then its gap has a wall from the other side

using EdgeEnds = std::pair<int, int>;
using SpacingAt = std::function<double(const Vector3&)>;

EdgeEnds ascending(int a, int b) {
  return {std::min(a, b), std::max(a, b)};
}

Vector3 middle_of_triangle(const SurfaceMesh& mesh, int triangle) {
  const Triangle& t = mesh.triangles[static_cast<std::size_t>(triangle)];
  return (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3;
}

double area_of_triangle(const SurfaceMesh& mesh, int triangle) {
  const Triangle& t = mesh.triangles[static_cast<std::size_t>(triangle)];
  return 0.5 * (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]).norm();
}

/// Whether it is more than a line, to rounding.
bool has_area(const SurfaceMesh& mesh, int triangle) {
  const Triangle& t = mesh.triangles[static_cast<std::size_t>(triangle)];
  const Vector3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  return (b - a).cross(c - a).norm() > 1e-9 * longest * longest;
}

/// The triangles for which `wanted` says so, with the vertices that they use.
template <class Wanted>
SurfaceMesh triangles_of(const SurfaceMesh& mesh, const Wanted& wanted) {
  SurfaceMesh part;
  std::vector<int> index(mesh.vertices.size(), -1);
  for (int t = 0; t < std::ssize(mesh.triangles); ++t) {
    if (!wanted(t))
      continue;
    Triangle corners = mesh.triangles[static_cast<std::size_t>(t)];
    for (int& v : corners) {
      if (index[v] < 0) {
        index[v] = static_cast<int>(part.vertices.size());
        part.vertices.push_back(mesh.vertices[v]);
      }
      v = index[v];
    }
    part.triangles.push_back(corners);
  }
  return part;
}

/// Halves edges that are too long, each for both of its triangles, until none is.
void refine(SurfaceMesh& mesh, const SpacingAt& spacing) {
  constexpr int most_passes = 12;
  for (int pass = 0; pass < most_passes; ++pass) {
    std::map<EdgeEnds, int> middles;
    const auto middle = [&](int a, int b) {
      const auto known = middles.find(ascending(a, b));
      if (known != middles.end())
        return known->second;
      const Vector3 x = 0.5 * (mesh.vertices[a] + mesh.vertices[b]);
      const bool is_long = (mesh.vertices[a] - mesh.vertices[b]).norm() > longest_edge * spacing(x);
      if (is_long)
        mesh.vertices.push_back(x);
      return middles[ascending(a, b)] = is_long ? static_cast<int>(mesh.vertices.size()) - 1 : -1;
    };
    std::vector<Triangle> finer;
    for (const Triangle& t : mesh.triangles) {
      const std::array<int, 3> m{middle(t[0], t[1]), middle(t[1], t[2]), middle(t[2], t[0])};
      const auto halved = std::count_if(m.begin(), m.end(), [](int v) { return v >= 0; });
      if (halved == 0) {
        finer.push_back(t);
        continue;
      }
      // Turned so that of one halved edge it is the first, and of two the third is whole.
      int turn = 0;
      while (halved < 3 && !(m[turn] >= 0 && (halved == 1 || m[(turn + 1) % 3] >= 0)))
        ++turn;
      const int a = t[turn], b = t[(turn + 1) % 3], c = t[(turn + 2) % 3];
      const int ab = m[turn], bc = m[(turn + 1) % 3], ca = m[(turn + 2) % 3];
      if (halved == 1)
        finer.insert(finer.end(), {{a, ab, c}, {ab, b, c}});
      else if (halved == 2)
        finer.insert(finer.end(), {{ab, b, bc}, {a, ab, bc}, {a, bc, c}});
      else
        finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    const bool is_done = finer.size() == mesh.triangles.size();
    mesh.triangles = std::move(finer);
    if (is_done)
      return;
  }
}

/// Triangles joined over edges that are not sharp: the number of its patch for each.
std::vector<int> patches_of(const SurfaceMesh& mesh) {
  std::map<EdgeEnds, std::vector<int>> of_edge;
  for (int t = 0; t < std::ssize(mesh.triangles); ++t)
    for (int e = 0; e < 3; ++e)
      of_edge[ascending(mesh.triangles[t][e], mesh.triangles[t][(e + 1) % 3])].push_back(t);
  std::vector<int> patch(mesh.triangles.size(), -1);
  int count = 0;
  for (int first = 0; first < std::ssize(mesh.triangles); ++first) {
    if (patch[first] >= 0)
      continue;
    std::vector<int> found{first};
    patch[first] = count;
    for (std::size_t next = 0; next < found.size(); ++next) {
      const int t = found[next];
      const Vector3 normal = triangle_normal(mesh, t);
      for (int e = 0; e < 3; ++e)
        for (const int other : of_edge[ascending(mesh.triangles[t][e], mesh.triangles[t][(e + 1) % 3])])
          if (patch[other] < 0 && triangle_normal(mesh, other).dot(normal) > sharp_cosine) {
            patch[other] = count;
            found.push_back(other);
          }
    }
    ++count;
  }
  return patch;
}

double distance_to_segment(const Vector3& x, const Vector3& from, const Vector3& to) {
  const Vector3 way = to - from;
  const double share = std::clamp((x - from).dot(way) / std::max(way.squaredNorm(), 1e-300), 0.0, 1.0);
  return (x - from - share * way).norm();
}

/// One side of a gap and its wall.
class GapWall {
 public:
  GapWall(SurfaceMesh patch, const SurfaceRays& rays, const SpacingAt& spacing)
      : patch_(std::move(patch)), rays_(rays), spacing_(spacing) {
    leave_blunt_bottoms();
  }

  /// Nothing is left of it above a blunt bottom.
  [[nodiscard]] bool empty() const { return patch_.triangles.empty(); }

  /// Half way from each triangle to the other side.
  [[nodiscard]] std::vector<Vector3> middles() const {
    std::vector<Vector3> places;
    places.reserve(patch_.triangles.size());
    for (int t = 0; t < std::ssize(patch_.triangles); ++t)
      places.push_back(
          across(middle_of_triangle(patch_, t), triangle_normal(patch_, t)).value_or(middle_of_triangle(patch_, t)));
    return places;
  }

  [[nodiscard]] SurfaceMesh build() {
    normals_ = vertex_normals(patch_);
    inner_.assign(patch_.vertices.size(), Vector3::Zero());
    std::vector<int> count(patch_.vertices.size(), 0);
    for (int t = 0; t < std::ssize(patch_.triangles); ++t)
      for (const int v : patch_.triangles[t]) {
        inner_[v] += middle_of_triangle(patch_, t);
        ++count[v];
      }
    wall_ = patch_;
    for (int v = 0; v < std::ssize(patch_.vertices); ++v) {
      const Vector3& x = patch_.vertices[v];
      inner_[v] = x + inwards * (inner_[v] / count[v] - x);
      // A wall's vertex above its own; where the ray meets nothing it lies on the surface, at the gap's end.
      const auto there = across(inner_[v], normals_[v]);
      wall_.vertices[v] = there ? Vector3(x + (*there - inner_[v])) : x;
      inner_[v] = there.value_or(inner_[v]);
    }
    add_border();
    return std::move(wall_);
  }

 private:
  [[nodiscard]] std::optional<Vector3> across(const Vector3& x, const Vector3& normal) const {
    const auto met = rays_.meet(x, normal, normal, 2 * widest_gap * spacing_(x));
    return met ? std::optional(met->point) : std::nullopt;
  }

  [[nodiscard]] std::map<EdgeEnds, int> directed_edges() const {
    std::map<EdgeEnds, int> directed;
    for (int t = 0; t < std::ssize(patch_.triangles); ++t)
      for (int e = 0; e < 3; ++e)
        directed[{patch_.triangles[t][e], patch_.triangles[t][(e + 1) % 3]}] = t;
    return directed;
  }

  /// In the surface, out of the patch.
  [[nodiscard]] Vector3 way_out(const EdgeEnds& edge, int triangle) const {
    return (patch_.vertices[edge.second] - patch_.vertices[edge.first])
        .cross(triangle_normal(patch_, triangle))
        .normalized();
  }

  /// Ends the patch at the centre of the largest circle that touches a blunt bottom and both sides: the stress at such
  /// a bottom is not that at the front of a crack, which a border in the material would bring [Creager and Paris 1967:
  /// its origin lies behind the bottom].
  void leave_blunt_bottoms() {
    struct Bottom {
      Vector3 from, to, way; // way: out of the patch
      double height;         // m, of the circle's centre above the edge
    };
    std::vector<Bottom> bottoms;
    const std::map<EdgeEnds, int> directed = directed_edges();
    for (const auto& [edge, triangle] : directed) {
      if (directed.find({edge.second, edge.first}) != directed.end())
        continue;
      const Vector3 &from = patch_.vertices[edge.first], &to = patch_.vertices[edge.second];
      const Vector3 normal = triangle_normal(patch_, triangle), middle = 0.5 * (from + to);
      const Vector3 place = middle + inwards * (middle_of_triangle(patch_, triangle) - middle);
      const auto half_way = across(place, normal);
      const double h = spacing_(middle), half = half_way ? (*half_way - place).norm() : 0;
      if (2 * half <= blunt * h)
        continue;
      const Vector3 way = way_out(edge, triangle);
      const auto bottom = rays_.meet(*half_way, normal, way, out_of_gap * h);
      if (bottom && bottom->width < half)
        bottoms.push_back({from, to, way, half - bottom->width});
    }
    if (bottoms.empty())
      return;
    for (Vector3& x : patch_.vertices) {
      const auto nearest = std::min_element(bottoms.begin(), bottoms.end(), [&](const Bottom& a, const Bottom& b) {
        return distance_to_segment(x, a.from, a.to) < distance_to_segment(x, b.from, b.to);
      });
      if (distance_to_segment(x, nearest->from, nearest->to) < nearest->height)
        x -= (nearest->height - (nearest->from - x).dot(nearest->way)) * nearest->way;
    }
    patch_ = triangles_of(patch_, [&](int t) { return has_area(patch_, t); });
  }

  /// The vertex to which the wall goes on from v along `way`.
  int beyond(int v, const Vector3& way) {
    const double h = spacing_(patch_.vertices[v]), half = (wall_.vertices[v] - patch_.vertices[v]).norm();
    const auto bottom = rays_.meet(inner_[v], normals_[v], way, out_of_gap * h);
    const bool is_blunt = bottom && 2 * half > blunt * h;
    const double length = !bottom    ? out_of_gap * h
                          : is_blunt ? std::max(bottom->width - half, into_bottom * h)
                                     : bottom->width + into_bottom * h;
    wall_.vertices.push_back(wall_.vertices[v] + length * way);
    return static_cast<int>(wall_.vertices.size()) - 1;
  }

  void add_border() {
    struct BorderEdge {
      int from, to;
      Vector3 way; // out of the patch
    };
    const std::map<EdgeEnds, int> directed = directed_edges();
    std::vector<BorderEdge> border;
    std::map<int, std::vector<int>> in, out; // border edges at a vertex
    for (const auto& [edge, triangle] : directed)
      if (const auto [a, b] = edge; directed.find({b, a}) == directed.end()) {
        in[b].push_back(static_cast<int>(border.size()));
        out[a].push_back(static_cast<int>(border.size()));
        border.push_back({a, b, way_out(edge, triangle)});
      }
    std::vector<std::array<int, 2>> ends(border.size(), {-1, -1}); // beyond `from` and `to`
    for (const auto& [v, arriving] : in) {
      const std::vector<int>& leaving = out[v];
      if (arriving.size() != 1 || leaving.size() != 1) { // patches that meet in a point
        for (const int e : arriving)
          ends[e][1] = beyond(v, border[e].way);
        for (const int e : leaving)
          ends[e][0] = beyond(v, border[e].way);
        continue;
      }
      const Vector3 &before = border[arriving.front()].way, &after = border[leaving.front()].way;
      const bool turns_out = before.cross(after).dot(normals_[v]) > 0 && before.dot(after) < sharp_cosine;
      const Vector3 mean = before + after;
      if (!turns_out && mean.norm() > 0.1) {
        ends[arriving.front()][1] = ends[leaving.front()][0] = beyond(v, mean.normalized());
        continue;
      }
      const int first = ends[arriving.front()][1] = beyond(v, before);
      const int last = ends[leaving.front()][0] = beyond(v, after);
      add({v, first, last});
    }
    for (std::size_t e = 0; e < border.size(); ++e) {
      add({border[e].to, border[e].from, ends[e][0]});
      add({border[e].to, ends[e][0], ends[e][1]});
    }
  }

  void add(const Triangle& corners) {
    wall_.triangles.push_back(corners);
    if (!has_area(wall_, static_cast<int>(wall_.triangles.size()) - 1))
      wall_.triangles.pop_back();
  }

  SurfaceMesh patch_, wall_;
  const SurfaceRays& rays_;
  const SpacingAt& spacing_;
  std::vector<Vector3> normals_, inner_; // inner_: places in the gap beside the vertices, where rays start
};

} // namespace

std::shared_ptr<const Incision> gap_walls(const std::shared_ptr<const Domain>& domain, const SpacingAt& spacing) {
  const SurfaceMesh& surface = domain->surface();
  const SurfaceRays rays(surface);
  const auto bounds_gap = [&](const SurfaceMesh& mesh, const Vector3& x, int t) {
    const Vector3 normal = triangle_normal(mesh, t);
    const auto met = rays.meet(x, normal, normal, widest_gap * spacing(x));
    return met && met->is_parallel;
  };
  SurfaceMesh sides = triangles_of(surface, [&](int t) {
    const std::vector<Vector3> places =
        places_of_triangle(surface, t, [&](const Vector3& x) { return longest_edge * spacing(x); });
    return std::any_of(places.begin(), places.end(), [&](const Vector3& x) { return bounds_gap(surface, x, t); });
  });
  if (sides.triangles.empty())
    return nullptr;
  refine(sides, spacing);
  sides = triangles_of(sides, [&](int t) { return bounds_gap(sides, middle_of_triangle(sides, t), t); });

  const std::vector<int> patch_of = patches_of(sides);
  const int count = patch_of.empty() ? 0 : 1 + *std::max_element(patch_of.begin(), patch_of.end());
  std::vector<std::pair<double, int>> sizes; // largest first
  std::vector<double> relative(static_cast<std::size_t>(count), 0);
  sizes.reserve(static_cast<std::size_t>(count));
  for (int p = 0; p < count; ++p)
    sizes.emplace_back(0, p);
  for (int t = 0; t < std::ssize(sides.triangles); ++t) {
    const double h = spacing(middle_of_triangle(sides, t));
    sizes[patch_of[t]].first -= area_of_triangle(sides, t);
    relative[patch_of[t]] += area_of_triangle(sides, t) / (h * h);
  }
  std::sort(sizes.begin(), sizes.end());
  std::vector<SurfaceMesh> walls;
  std::vector<Vector3> taken; // middles of the walls that there are
  for (const auto& [size, p] : sizes) {
    if (relative[p] < least_gap_area)
      continue;
    GapWall wall(triangles_of(sides, [&, patch = p](int t) { return patch_of[t] == patch; }), rays, spacing);
    if (wall.empty())
      continue;
    const std::vector<Vector3> middles = wall.middles();
    if (!taken.empty()) {
      const PointTree tree(taken);
      const auto known = std::count_if(middles.begin(), middles.end(), [&](const Vector3& x) {
        return std::sqrt(tree.nearest(x).squared_distance) < longest_edge * spacing(x);
      });
      if (static_cast<double>(known) > known_share * static_cast<double>(middles.size()))
        continue;
    }
    taken.insert(taken.end(), middles.begin(), middles.end());
    walls.push_back(wall.build());
  }
  if (walls.empty())
    return nullptr;
  return std::make_shared<const Incision>(std::vector<SurfaceMesh>{}, domain, 0, std::move(walls));
}

std::shared_ptr<const Incision> with_walls(const std::shared_ptr<const Incision>& cut,
                                           const std::shared_ptr<const Incision>& walls) {
  if (cut == nullptr || walls == nullptr)
    return cut == nullptr ? walls : cut;
  return std::make_shared<const Incision>(cut->sheets(), cut->domain(), cut->revision(), walls->sheets());
}

} // namespace spherecut::topology
