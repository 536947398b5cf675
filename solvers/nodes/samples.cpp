#include "solvers/nodes/samples.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr double finest_of_extent = 1e-7;

void refuse_above(double expected, int maximum_nodes, const SpacingField& spacing) {
  if (expected > 1.1 * maximum_nodes + 10)
    throw InputError(fmt::format("sprinkle: the body needs more than {} nodes at spacings of {} to {} m; the limit is "
                                 "maximum_nodes = {}",
                                 static_cast<int>(expected), spacing.fine, spacing.coarse, maximum_nodes));
}

class VolumeSampler {
 public:
  VolumeSampler(const topology::Domain& domain, const SpacingField& spacing, double fraction, int maximum_nodes,
                const BoundingBox* region)
      : domain_(domain), spacing_(spacing), fraction_(fraction), maximum_nodes_(maximum_nodes), region_(region) {}

  /// `inside`: the whole cell is known to lie in the body.
  void visit(const Vector3& centre, double size, bool inside) {
    double distance = 0;
    if (region_ != nullptr &&
        ((region_->lower - centre).maxCoeff() > 0.5 * size || (centre - region_->upper).maxCoeff() > 0.5 * size))
      return;
    if (!inside) {
      distance = domain_.signed_distance(centre);
      const double half_diagonal = 0.5 * std::sqrt(3.0) * size;
      if (distance > half_diagonal)
        return;
      inside = distance < -half_diagonal;
    }
    interruption_point();
    const double h = spacing_(centre);
    // h at the centre decides: within a cell it falls by at most slope times half the diagonal, 0.87 slope size.
    if (size > fraction_ * h * (1 + 1e-9)) {
      for (int corner = 0; corner < 8; ++corner) {
        const Vector3 towards((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
        visit(centre + 0.25 * size * towards, 0.5 * size, inside);
      }
      return;
    }
    const double filled = inside ? 1 : std::clamp(0.5 - distance / size, 0.0, 1.0);
    const double cells = size / h;
    expected_ += filled * cells * cells * cells;
    refuse_above(expected_, maximum_nodes_, spacing_);
    samples_.push_back({centre, h, filled * cells * cells * cells});
  }

  std::vector<VolumeSample> take() { return std::move(samples_); }

 private:
  const topology::Domain& domain_;
  const SpacingField& spacing_;
  double fraction_;
  int maximum_nodes_;
  const BoundingBox* region_;
  double expected_ = 0;
  std::vector<VolumeSample> samples_;
};

} // namespace

std::vector<VolumeSample> sample_volume(const topology::Domain& domain, const SpacingField& spacing, double fraction,
                                        int maximum_nodes, const BoundingBox* region) {
  // Root cubes on a lattice such that halving them meets fraction h exactly where h is uniform. The lattice is centred
  // on the body: symmetric bodies get symmetric samples.
  const BoundingBox box = domain.bounds();
  if (!(spacing.finest() > finest_of_extent * box.extent().maxCoeff())) // halving would come to no end
    throw InputError(fmt::format("sprinkle: a spacing of {:g} m in a body of {:g} m; it must be above {:g} of that",
                                 spacing.finest(), box.extent().maxCoeff(), finest_of_extent));
  double root = fraction * spacing.finest();
  while (root < 0.25 * box.extent().maxCoeff())
    root *= 2;
  VolumeSampler sampler(domain, spacing, fraction, maximum_nodes, region);
  std::array<int, 3> count{};
  for (int d = 0; d < 3; ++d)
    count[d] = std::max(1, static_cast<int>(std::ceil(box.extent()[d] / root - 1e-9)));
  const Vector3 origin = box.centre() - 0.5 * root * Vector3(count[0], count[1], count[2]);
  for (int k = 0; k < count[2]; ++k)
    for (int j = 0; j < count[1]; ++j)
      for (int i = 0; i < count[0]; ++i)
        sampler.visit(origin + root * Vector3(i + 0.5, j + 0.5, k + 0.5), root, false);
  return sampler.take();
}

std::vector<SurfaceSample> sample_surface(const topology::SurfaceMesh& mesh, const SpacingField& spacing,
                                          double fraction, int maximum_nodes) {
  std::vector<SurfaceSample> samples;
  samples.reserve(mesh.triangles.size());
  double expected = 0;
  std::vector<std::array<Vector3, 3>> pieces; // of the current triangle, still to be halved or taken
  for (const Triangle& triangle : mesh.triangles) {
    interruption_point();
    pieces.assign(1, {mesh.vertices[triangle[0]], mesh.vertices[triangle[1]], mesh.vertices[triangle[2]]});
    while (!pieces.empty()) {
      const auto [a, b, c] = pieces.back();
      pieces.pop_back();
      const Vector3 centroid = (a + b + c) / 3;
      const double h = spacing(centroid);
      const double ab = (b - a).squaredNorm(), bc = (c - b).squaredNorm(), ca = (a - c).squaredNorm();
      if (std::max({ab, bc, ca}) <= fraction * fraction * h * h) {
        const double share = 0.5 * (b - a).cross(c - a).norm() / (h * h);
        expected += share;
        refuse_above(0.5 * expected, maximum_nodes, spacing);
        samples.push_back({centroid, h, share});
      } else if (ab >= bc && ab >= ca) { // halve the longest edge
        const Vector3 m = 0.5 * (a + b);
        pieces.push_back({a, m, c});
        pieces.push_back({m, b, c});
      } else if (bc >= ca) {
        const Vector3 m = 0.5 * (b + c);
        pieces.push_back({a, b, m});
        pieces.push_back({a, m, c});
      } else {
        const Vector3 m = 0.5 * (c + a);
        pieces.push_back({a, b, m});
        pieces.push_back({m, b, c});
      }
    }
  }
  return samples;
}

} // namespace spherecut::solvers
