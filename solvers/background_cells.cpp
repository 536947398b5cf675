#include "solvers/background_cells.hpp"

#include "topology/errors.hpp"
#include "topology/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

/// Halving a cell that is a little too large would cost eight times the points: where the spacing is graded, cells
/// range from slack / 2 to slack times the size asked for.
constexpr double slack = 1.6;

/// Part of a box on the inner side of a plane through it, by the distance of its centre: exact for a box cut parallel
/// to a face, second order otherwise.
double inside_fraction(double distance, const Vector3& normal, const Vector3& half) {
  const double reach = normal.cwiseAbs().dot(half);
  return std::clamp(0.5 - 0.5 * distance / reach, 0.0, 1.0);
}

class Octree {
 public:
  Octree(const topology::Domain& domain, const NodeCloud& nodes, const BackgroundOptions& options)
      : domain_(domain), nodes_(nodes), options_(options), tree_(nodes.positions) {}

  BackgroundCells build() {
    // Roots as large as the coarsest spacing allows, fitted to the bounding box: a uniform cloud needs no division.
    const BoundingBox box = domain_.bounds();
    const double coarsest = *std::max_element(nodes_.spacings.begin(), nodes_.spacings.end());
    std::array<int, 3> roots{};
    Vector3 size;
    for (int c = 0; c < 3; ++c) {
      roots[c] = std::max(1, static_cast<int>(std::ceil(box.extent()[c] / (options_.cell_size * coarsest) - 1e-6)));
      size[c] = box.extent()[c] / roots[c];
    }
    for (int a = 0; a < roots[0]; ++a)
      for (int b = 0; b < roots[1]; ++b)
        for (int c = 0; c < roots[2]; ++c) {
          const Vector3 corner = box.lower + size.cwiseProduct(Vector3(a, b, c));
          divide(corner, corner + size);
        }
    return std::move(cells_);
  }

 private:
  double spacing_near(const Vector3& x) const { return nodes_.spacings[tree_.nearest(x).index]; }

  void divide(const Vector3& lower, const Vector3& upper) {
    const Vector3 centre = 0.5 * (lower + upper), half = 0.5 * (upper - lower);
    const double distance = domain_.signed_distance(centre);
    const double radius = half.norm();
    if (distance > radius)
      return;
    const double longest = 2 * half.maxCoeff();
    // A coarse node may be nearest to the centre while fine ones sit in a corner: large cells always divide.
    if (longest > slack * options_.cell_size * spacing_near(centre) || holds_finer_node(centre, half, longest)) {
      std::array<int, 3> parts{};
      for (int c = 0; c < 3; ++c)
        parts[c] = half[c] > 0.3 * longest ? 2 : 1;
      const Vector3 size = (upper - lower).cwiseQuotient(Vector3(parts[0], parts[1], parts[2]));
      for (int a = 0; a < parts[0]; ++a)
        for (int b = 0; b < parts[1]; ++b)
          for (int c = 0; c < parts[2]; ++c) {
            const Vector3 corner = lower + size.cwiseProduct(Vector3(a, b, c));
            divide(corner, corner + size);
          }
      return;
    }
    const bool inside = distance < -radius || corners_inside(centre, half);
    if (inside)
      add_gauss(centre, half);
    else
      add_cut(centre, half);
    if (std::ssize(cells_.points) > cells_.start.back())
      cells_.start.push_back(static_cast<int>(cells_.points.size()));
  }

  bool holds_finer_node(const Vector3& centre, const Vector3& half, double longest) {
    found_.clear();
    tree_.within(centre, half.norm(), found_);
    return std::any_of(found_.begin(), found_.end(), [&](const topology::PointTree::Found& node) {
      return ((nodes_.positions[node.index] - centre).cwiseAbs().array() <= half.array()).all() &&
             longest > 1.3 * slack * options_.cell_size * nodes_.spacings[node.index];
    });
  }

  bool corners_inside(const Vector3& centre, const Vector3& half) const {
    for (int k = 0; k < 8; ++k) {
      const Vector3 corner = centre + half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
      if (domain_.signed_distance(corner) > 1e-9 * half.norm())
        return false;
    }
    return true;
  }

  void add_gauss(const Vector3& centre, const Vector3& half) {
    static constexpr std::array<std::array<double, 3>, 3> places = {
        {{0, 0, 0}, {-0.5773502691896257, 0.5773502691896257, 0}, {-0.7745966692414834, 0, 0.7745966692414834}}};
    static constexpr std::array<std::array<double, 3>, 3> weights = {
        {{2, 0, 0}, {1, 1, 0}, {5.0 / 9, 8.0 / 9, 5.0 / 9}}};
    const int n = options_.gauss;
    const double volume = half.prod();
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        for (int c = 0; c < n; ++c)
          cells_.points.push_back(
              {centre + half.cwiseProduct(Vector3(places[n - 1][a], places[n - 1][b], places[n - 1][c])),
               volume * weights[n - 1][a] * weights[n - 1][b] * weights[n - 1][c]});
  }

  void add_cut(const Vector3& centre, const Vector3& half) {
    constexpr int parts = 2;  // octants per direction
    constexpr int detail = 2; // samples per direction in an octant
    const Vector3 octant_half = half / parts, sample_half = octant_half / detail;
    for (int octant = 0; octant < parts * parts * parts; ++octant) {
      const Vector3 middle =
          centre + octant_half.cwiseProduct(Vector3(octant & 1 ? 1 : -1, octant & 2 ? 1 : -1, octant & 4 ? 1 : -1));
      double volume = 0;
      Vector3 moment = Vector3::Zero();
      for (int k = 0; k < 8; ++k) {
        const Vector3 x = middle + sample_half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
        const double distance = domain_.signed_distance(x);
        double fraction = distance < 0 ? 1 : 0;
        Vector3 place = x;
        if (std::abs(distance) < sample_half.norm()) {
          const Vector3 n = domain_.normal(x);
          fraction = inside_fraction(distance, n, sample_half);
          place -= (1 - fraction) * n.cwiseAbs().dot(sample_half) * n; // centroid of what remains
        }
        const double part = fraction * 8 * sample_half.prod();
        volume += part;
        moment += part * place;
      }
      if (volume > 1e-3 * 8 * octant_half.prod())
        cells_.points.push_back({moment / volume, volume});
    }
  }

  const topology::Domain& domain_;
  const NodeCloud& nodes_;
  BackgroundOptions options_;
  topology::PointTree tree_;
  std::vector<topology::PointTree::Found> found_;
  BackgroundCells cells_;
};

} // namespace

BackgroundCells background_cells(const topology::Domain& domain, const NodeCloud& nodes,
                                 const BackgroundOptions& options) {
  if (options.gauss < 1 || options.gauss > 3)
    throw InputError(fmt::format("quadrature of {} points per direction; there are 1, 2 and 3", options.gauss));
  if (!(options.cell_size > 0) || !std::isfinite(options.cell_size))
    throw InputError(fmt::format("background cells of {} node spacings: the size must be positive", options.cell_size));
  if (nodes.size() == 0)
    throw InputError("background cells need nodes: their spacings set the size");
  return Octree(domain, nodes, options).build();
}

std::vector<SurfacePoint> surface_quadrature(const topology::Domain& domain, const NodeCloud& nodes, double edge,
                                             double centroid_below) {
  const topology::PointTree tree(nodes.positions);
  const topology::SurfaceMesh& surface = domain.surface();
  std::vector<SurfacePoint> points;
  std::vector<std::array<Vector3, 3>> pending;
  for (const Triangle& triangle : surface.triangles) {
    pending.push_back({surface.vertices[triangle[0]], surface.vertices[triangle[1]], surface.vertices[triangle[2]]});
    while (!pending.empty()) {
      const std::array<Vector3, 3> t = pending.back();
      pending.pop_back();
      const Vector3 centre = (t[0] + t[1] + t[2]) / 3;
      const double spacing = nodes.spacings[tree.nearest(centre).index];
      const double longest = std::max({(t[1] - t[0]).norm(), (t[2] - t[1]).norm(), (t[0] - t[2]).norm()});
      if (longest > edge * spacing) {
        const Vector3 a = 0.5 * (t[0] + t[1]), b = 0.5 * (t[1] + t[2]), c = 0.5 * (t[2] + t[0]);
        pending.push_back({t[0], a, c});
        pending.push_back({a, t[1], b});
        pending.push_back({c, b, t[2]});
        pending.push_back({a, b, c});
        continue;
      }
      const Vector3 area = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]);
      const double size = area.norm();
      if (size > 0 && longest < centroid_below * spacing)
        points.push_back({centre, area / size, size});
      else if (size > 0)
        for (const Vector3& corner : t)
          points.push_back({0.5 * (centre + corner), area / size, size / 3});
    }
  }
  return points;
}

} // namespace spherecut::solvers
