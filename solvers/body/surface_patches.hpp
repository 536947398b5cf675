// Shares of the surface: which part of the skin belongs to which node, and the mean displacement over it.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "solvers/quadrature/background_cells.hpp"
#include "solvers/shapes/functions.hpp"
#include "topology/search/point_tree.hpp"

#include <optional>

namespace spherecut::solvers {

/// A linear functional of the displacement with unit total weight: sum_k weight[k] alpha_{node[k]}.
struct DisplacementMean {
  std::vector<int> nodes; // ascending
  std::vector<double> weights;
  Vector3 centroid = Vector3::Zero(); // m, of the share
  double area = 0;                    // m2, 0 when the mean is the value at a point
  std::vector<QuadraturePoint> share; // the points it is taken over; weights add up to one
  [[nodiscard]] Vector3 of(const VectorX& coefficients) const;
  /// The same mean of a field given point by point.
  [[nodiscard]] Vector3 of(const std::function<Vector3(const Vector3& x)>& field) const;
};

/// The mean over the same share with the shape functions of `spheres`. Throws NumericalError.
DisplacementMean reweighed(const DisplacementMean& mean, const Spheres& spheres);

/// Value at one point. Throws NumericalError when no sound support covers it.
DisplacementMean value_at(const Spheres& spheres, const Vector3& x);

/// Index of the nearest position that the cut (may be null) does not hide from x; of the nearest when it hides all.
/// Found sooner where the position `guess` is near.
int nearest_in_sight(const topology::PointTree& tree, const std::vector<Vector3>& positions,
                     const topology::Incision* incision, const Vector3& x, int guess = -1);

/// The surface and the faces of the incision, point by point, with the node that each point belongs to: the nearest
/// surface node or, on a face, lip node that it sees.
class SurfacePatches {
 public:
  enum class Of { skin_and_faces, faces };

  /// `opaque`: Problem::opaque. With a `part`, m, only shares that lie within it are meant to be asked for; of `faces`
  /// only those of lip nodes.
  SurfacePatches(const topology::Domain& domain, const NodeCloud& nodes,
                 const std::shared_ptr<const topology::Incision>& incision = nullptr,
                 const std::optional<BoundingBox>& part = std::nullopt, Of of = Of::skin_and_faces,
                 const std::shared_ptr<const topology::Incision>& opaque = nullptr);

  /// All points that the shares are made of.
  [[nodiscard]] std::span<const SurfacePoint> points() const { return points_; }
  /// So many of them, the first, lie on the surface; the others on the faces of the incision.
  [[nodiscard]] std::size_t skin_points() const { return static_cast<std::size_t>(faces_begin_); }

  /// Mean over the share of `node` of the surface that is not held along all axes (`held` empty: all of it) or, for a
  /// lip node, of its face; the node itself when it has no share.
  [[nodiscard]] DisplacementMean mean(int node, const Spheres& spheres, const HeldRegion& held = nullptr) const {
    return mean(node, spheres, held, std::nullopt);
  }

  /// What a force of a tool on `node` acts on: that mean, of a share about a sharp edge over the side that faces the
  /// tool (Problem::touched_from), whose mean lies on the surface and not within the body. Where several sides face it
  /// alike, the node itself. `node` is one of this cloud; of the problem the rest is asked for.
  [[nodiscard]] DisplacementMean contact_mean(int node, const Spheres& spheres, const Problem& problem) const {
    return mean(node, spheres, problem.prescribed_region, problem.touched_from);
  }

  /// Means over the parts of `held` that belong to each entry: of what is held along its components. A point nearest to
  /// none of the entries' nodes goes to the nearest of them, so that the whole is shared out.
  [[nodiscard]] std::vector<DisplacementMean> means(const std::vector<Prescribed>& entries, const Spheres& spheres,
                                                    const HeldRegion& held) const;

  /// The same for `nodes` that are held alike.
  [[nodiscard]] std::vector<DisplacementMean>
  means(const std::vector<int>& nodes, const Spheres& spheres,
        const std::function<bool(const Vector3&, const Vector3&)>& held) const;

 private:
  [[nodiscard]] DisplacementMean mean(int node, const Spheres& spheres, const HeldRegion& held,
                                      const std::optional<Vector3>& facing) const;

  const NodeCloud& nodes_;
  std::shared_ptr<const topology::Incision> incision_; // what hides nodes from points
  std::vector<SurfacePoint> points_;                   // of the surface, then from faces_begin_ on of the faces
  int faces_begin_ = 0;
  std::vector<std::vector<int>> points_of_node_;
  std::vector<int> owners_; // node of every point of the surface; -1: the cloud has no surface nodes
};

} // namespace spherecut::solvers
