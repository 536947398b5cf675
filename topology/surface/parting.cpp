#include "topology/surface/parting.hpp"

#include "topology/surface/triangle_corners.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <tuple>
#include <utility>

namespace spherecut::topology {

namespace {

constexpr double parted_share = 1e-3; // of the way to the mean of its neighbours, by which a copy moves
constexpr double same_angle = 1e-6;   // radians: two faces so near to each other lie on each other
constexpr int most_rounds = 10;       // an edge whose ends cannot be doubled is divided, and looked at again

/// One side of a triangle: the edge low < high, and whether the triangle runs from low to high.
struct TriangleSide {
  int low, high, triangle;
  bool rising;
};

std::vector<TriangleSide> sides_of(const SurfaceMesh& mesh) {
  std::vector<TriangleSide> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (int t = 0; t < std::ssize(mesh.triangles); ++t)
    for (int e = 0; e < 3; ++e) {
      const int a = mesh.triangles[t][e], b = mesh.triangles[t][(e + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  std::sort(sides.begin(), sides.end(), [](const TriangleSide& p, const TriangleSide& q) {
    return std::tie(p.low, p.high, p.triangle) < std::tie(q.low, q.high, q.triangle);
  });
  return sides;
}

/// Two faces that belong together at an edge.
struct FacePair {
  int low, high, first, second;
};

class SurfaceParter {
 public:
  SurfaceParter(SurfaceMesh& mesh, std::vector<int>& labels, PartedBy by)
      : mesh_(mesh), labels_(labels), by_(by), inside_out_(by == PartedBy::material && volume(mesh) < 0) {}

  /// One round; true when edges had to be divided, and another round is due.
  bool round(Parting& parting) {
    corners_.resize(3 * mesh_.triangles.size());
    std::iota(corners_.begin(), corners_.end(), 0);
    crowded_.clear();
    const std::vector<TriangleSide> sides = sides_of(mesh_);
    for (std::size_t first = 0, last = 0; first < sides.size(); first = last) {
      while (last < sides.size() && sides[last].low == sides[first].low && sides[last].high == sides[first].high)
        ++last;
      if (last - first == 2)
        join({sides[first].low, sides[first].high, sides[first].triangle, sides[first + 1].triangle});
      else if (last - first > 2 && !pair_faces(std::vector(sides.begin() + static_cast<std::ptrdiff_t>(first),
                                                           sides.begin() + static_cast<std::ptrdiff_t>(last))))
        parting.ambiguous.push_back(
            {sides[first].low, sides[first].high, static_cast<int>(last - first), sides[first].triangle});
    }
    if (!parting.ambiguous.empty())
      return false;
    double_vertices(parting);
    return divide_edges();
  }

  [[nodiscard]] int crowded_edges() const {
    int edges = 0;
    for (std::size_t p = 0; p < crowded_.size(); ++p)
      edges += p == 0 || crowded_[p].low != crowded_[p - 1].low || crowded_[p].high != crowded_[p - 1].high ? 1 : 0;
    return edges;
  }

 private:
  int root(int corner) {
    while (corners_[corner] != corner)
      corner = corners_[corner] = corners_[corners_[corner]];
    return corner;
  }

  void join(const FacePair& pair) {
    for (const int vertex : {pair.low, pair.high}) {
      const int a = root(3 * pair.first + corner_at(mesh_.triangles[pair.first], vertex));
      const int b = root(3 * pair.second + corner_at(mesh_.triangles[pair.second], vertex));
      corners_[std::max(a, b)] = std::min(a, b);
    }
  }

  bool pair_faces(const std::vector<TriangleSide>& faces) {
    const Vector3& a = mesh_.vertices[faces.front().low];
    const Vector3 axis = (mesh_.vertices[faces.front().high] - a).normalized();
    const Vector3 u = axis.unitOrthogonal(), v = axis.cross(u);
    std::vector<std::pair<double, TriangleSide>> around;
    for (const TriangleSide& side : faces) {
      const Triangle& t = mesh_.triangles[side.triangle];
      const Vector3 apex = mesh_.vertices[t[0] + t[1] + t[2] - side.low - side.high] - a;
      around.emplace_back(std::atan2(apex.dot(v), apex.dot(u)), side);
    }
    std::sort(around.begin(), around.end(), [](const auto& p, const auto& q) {
      return std::tie(p.first, p.second.triangle) < std::tie(q.first, q.second.triangle);
    });
    for (std::size_t i = 0; i < around.size(); ++i) {
      const double next = i + 1 < around.size() ? around[i + 1].first : around[0].first + 2 * std::numbers::pi;
      if (!(next - around[i].first > same_angle))
        return false;
    }
    return by_ == PartedBy::material ? pair_by_material(around) : pair_by_flatness(around);
  }

  /// The outer side of a rising face is that of greater angles: material lies from a falling face to the next, rising.
  bool pair_by_material(const std::vector<std::pair<double, TriangleSide>>& around) {
    const std::size_t count = around.size();
    for (std::size_t i = 0; i < count; ++i)
      if (around[i].second.rising == around[(i + 1) % count].second.rising)
        return false;
    for (std::size_t i = 0; i < count; ++i) {
      const TriangleSide &side = around[i].second, &next = around[(i + 1) % count].second;
      if (side.rising == inside_out_)
        add_pair({side.low, side.high, side.triangle, next.triangle});
    }
    return true;
  }

  bool pair_by_flatness(const std::vector<std::pair<double, TriangleSide>>& around) {
    struct Option {
      double bend; // radians off a straight continuation
      std::size_t first, second;
    };
    std::vector<Option> options;
    for (std::size_t i = 0; i < around.size(); ++i)
      for (std::size_t j = i + 1; j < around.size(); ++j)
        options.push_back({std::abs(around[j].first - around[i].first - std::numbers::pi), i, j});
    std::sort(options.begin(), options.end(), [](const Option& p, const Option& q) {
      return std::tie(p.bend, p.first, p.second) < std::tie(q.bend, q.first, q.second);
    });
    std::vector<char> taken(around.size(), 0);
    for (const Option& option : options) {
      if (taken[option.first] != 0 || taken[option.second] != 0 || option.bend > 0.5 * std::numbers::pi)
        continue;
      taken[option.first] = taken[option.second] = 1;
      const TriangleSide& side = around[option.first].second;
      add_pair({side.low, side.high, side.triangle, around[option.second].second.triangle});
    }
    return true;
  }

  void add_pair(const FacePair& pair) {
    join(pair);
    crowded_.push_back(pair);
  }

  /// Every fan of triangles about a vertex gets a copy of it.
  void double_vertices(Parting& parting) {
    struct Fan {
      int root;
      Vector3 sum = Vector3::Zero(); // of the neighbours
      int neighbours = 0;
      int vertex = -1;
    };
    std::vector<std::vector<Fan>> fans(mesh_.vertices.size());
    const auto fan_of = [&](int vertex, int corner) -> Fan& {
      const int at = root(corner);
      auto& here = fans[vertex];
      const auto found = std::find_if(here.begin(), here.end(), [&](const Fan& fan) { return fan.root == at; });
      return found != here.end() ? *found : here.emplace_back(Fan{at});
    };
    for (int t = 0; t < std::ssize(mesh_.triangles); ++t)
      for (int e = 0; e < 3; ++e) {
        Fan& fan = fan_of(mesh_.triangles[t][e], 3 * t + e);
        for (const int other : {(e + 1) % 3, (e + 2) % 3})
          fan.sum += mesh_.vertices[mesh_.triangles[t][other]];
        fan.neighbours += 2;
      }
    std::vector<std::pair<int, Vector3>> moves;
    for (int v = 0; v < std::ssize(fans); ++v) {
      if (fans[v].size() < 2)
        continue;
      const auto offset = [&](const Fan& fan) -> Vector3 { return fan.sum / fan.neighbours - mesh_.vertices[v]; };
      const auto flattest = std::min_element(fans[v].begin(), fans[v].end(), [&](const Fan& p, const Fan& q) {
        return offset(p).squaredNorm() < offset(q).squaredNorm();
      });
      ++parting.vertices;
      for (Fan& fan : fans[v]) {
        const bool stays = &fan == &*flattest;
        fan.vertex = stays ? v : static_cast<int>(mesh_.vertices.size() + moves.size());
        if (!stays)
          moves.emplace_back(v, by_ == PartedBy::material ? Vector3(parted_share * offset(fan)) : Vector3::Zero());
      }
    }
    for (int t = 0; t < std::ssize(mesh_.triangles); ++t)
      for (int e = 0; e < 3; ++e)
        if (const int v = mesh_.triangles[t][e]; fans[v].size() > 1)
          renamed_.push_back({3 * t + e, fan_of(v, 3 * t + e).vertex});
    for (const auto& [corner, vertex] : renamed_)
      mesh_.triangles[corner / 3][corner % 3] = vertex;
    renamed_.clear();
    for (const auto& [v, move] : moves) {
      mesh_.vertices.emplace_back(mesh_.vertices[v] + move);
      parting.movement = std::max(parting.movement, move.norm());
    }
  }

  /// Pairs whose edge joins the same two vertices as that of another pair: it gets a vertex of its own in the middle.
  bool divide_edges() {
    std::vector<std::pair<std::pair<int, int>, FacePair>> edges; // with their vertices now
    const auto now = [&](const FacePair& pair) {
      std::vector<int> shared;
      for (const int v : mesh_.triangles[pair.first])
        if (corner_at(mesh_.triangles[pair.second], v) < 3)
          shared.push_back(v);
      std::sort(shared.begin(), shared.end());
      return std::pair(shared.front(), shared.back());
    };
    for (const FacePair& pair : crowded_)
      edges.emplace_back(now(pair), pair);
    std::stable_sort(edges.begin(), edges.end(), [](const auto& p, const auto& q) { return p.first < q.first; });
    std::vector<char> touched(mesh_.triangles.size(), 0);
    bool divided = false;
    for (std::size_t i = 1; i < edges.size(); ++i) {
      const auto& [ends, pair] = edges[i];
      if (ends != edges[i - 1].first)
        continue;
      divided = true;
      if (touched[pair.first] != 0 || touched[pair.second] != 0)
        continue;
      touched[pair.first] = touched[pair.second] = 1;
      divide(pair, ends.first, ends.second);
    }
    return divided;
  }

  void divide(const FacePair& pair, int low, int high) {
    const auto apex = [&](int t) {
      const Triangle& corners = mesh_.triangles[t];
      return corners[0] + corners[1] + corners[2] - low - high;
    };
    const Vector3 middle = 0.5 * (mesh_.vertices[low] + mesh_.vertices[high]);
    const Vector3 inward = 0.5 * (mesh_.vertices[apex(pair.first)] + mesh_.vertices[apex(pair.second)]) - middle;
    const int vertex = static_cast<int>(mesh_.vertices.size());
    mesh_.vertices.emplace_back(middle + (by_ == PartedBy::material ? parted_share : 0) * inward);
    for (const int t : {pair.first, pair.second}) {
      Triangle half = mesh_.triangles[t];
      half[corner_at(half, low)] = vertex;
      mesh_.triangles[t][corner_at(mesh_.triangles[t], high)] = vertex;
      mesh_.triangles.push_back(half);
      labels_.push_back(labels_[t]);
    }
  }

  SurfaceMesh& mesh_;
  std::vector<int>& labels_;
  PartedBy by_;
  bool inside_out_;
  std::vector<int> corners_;                 // union of the corners 3 t + e of one fan
  std::vector<FacePair> crowded_;            // of edges with more than two faces
  std::vector<std::pair<int, int>> renamed_; // corner, vertex
};

} // namespace

Parting part_surface(SurfaceMesh& mesh, std::vector<int>& labels, PartedBy by) {
  Parting parting;
  SurfaceParter parter(mesh, labels, by);
  for (int round = 0; round < most_rounds; ++round) {
    const bool again = parter.round(parting);
    if (round == 0)
      parting.edges = parter.crowded_edges();
    if (!again)
      break;
  }
  return parting;
}

} // namespace spherecut::topology
