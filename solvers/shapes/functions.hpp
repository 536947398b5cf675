// Moving least squares shape functions on spheres of influence [De 2001, Eqs. 2 and 3].
#pragma once

#include "solvers/nodes/nodes.hpp"
#include "solvers/shapes/sight.hpp"
#include "solvers/shapes/sphere_grid.hpp"

#include <memory>
#include <span>

namespace spherecut::solvers {

enum class Basis { linear, quadratic }; // P = {1, x, y, z} or all monomials up to degree two

/// Quartic spline weight, 1 - 6 s^2 + 8 s^3 - 3 s^4 for s = r / R < 1, else 0.
double quartic_spline(double s);

class CutSight;
class InterfaceRamps;

/// The spheres of a node cloud with a search grid. Immutable once built; queries are thread safe. Where there is an
/// incision no sphere reaches through it: a node that is hidden from a point does not support it, or, by the rules that
/// bend around the front, supports it by the length of the shortest way. Points and nodes are plain geometry: those on
/// a face stand a little off it (lip_offset).
class Spheres {
 public:
  /// Radii rho * spacing. Where the support of a node (the nodes whose spheres hold it) has fewer than basis + 2
  /// members or a moment matrix worse conditioned than `worst_condition`, the spheres around it grow by 1.25 until it
  /// is sound. Throws NumericalError naming the node when six steps do not help, InputError when there are fewer than
  /// basis + 2 nodes, a centre is not finite, a spacing, rho or worst_condition is not positive, an incision or regions
  /// are given with the quadratic basis, or both of them.
  Spheres(std::vector<Vector3> centres, const std::vector<double>& spacings, double rho, Basis basis = Basis::linear,
          double worst_condition = 1e9, const Sight& sight = {});

  [[nodiscard]] int size() const { return static_cast<int>(centres_.size()); }
  [[nodiscard]] const std::vector<Vector3>& centres() const { return centres_; }
  [[nodiscard]] const std::vector<double>& radii() const { return radii_; } // m
  [[nodiscard]] Basis basis() const { return basis_; }
  [[nodiscard]] int grown() const { return grown_; } // spheres that had to grow
  [[nodiscard]] double worst_condition() const { return worst_condition_; }
  /// Ids of every sphere that may hold x, ascending; a superset of those that do, about 2 to 3 times as many.
  [[nodiscard]] std::span<const int> candidates(const Vector3& x) const { return grid_->find(x).ids; }
  [[nodiscard]] const SphereGrid& grid() const { return *grid_; }
  /// What the spheres know of the cut; null when there is none.
  [[nodiscard]] const CutSight* cut() const { return cut_.get(); }
  /// What they know of faces between materials; null when there are none.
  [[nodiscard]] const InterfaceRamps* ramps() const { return ramps_.get(); }

 private:
  struct Growing;

  std::vector<Vector3> centres_;
  std::vector<double> radii_;
  Basis basis_;
  double worst_condition_;
  int grown_ = 0;
  std::shared_ptr<const SphereGrid> grid_;
  std::shared_ptr<CutSight> cut_;
  std::shared_ptr<const InterfaceRamps> ramps_;
};

/// Three unknowns each of which carries a vector function: what is gathered along the front of a cut.
struct VectorTerm {
  int group = -1;                  // its coefficients are 3 group .. 3 group + 2 of a field
  Matrix3 value;                   // displacement of every unknown, a column each
  std::array<Matrix3, 3> gradient; // of every unknown, du_i/dx_j, 1/m
};

/// Shape functions at one point; arrays have one entry per supporting node. Reuse the object: it keeps its memory.
struct ShapeFunctions {
  std::vector<int> nodes;
  std::vector<double> value;                        // h_j(x)
  std::vector<double> dx, dy, dz;                   // gradient, 1/m
  std::vector<double> dxx, dyy, dzz, dxy, dxz, dyz; // 1/m2, filled by evaluate_second alone
  double moment_condition = 0;                      // 1-norm condition of the scaled moment matrix
  std::vector<VectorTerm> vectors{}; // of a body with a cut that appends (Discretisation::shape_at alone)
  [[nodiscard]] int size() const { return static_cast<int>(nodes.size()); }
  [[nodiscard]] Vector3 gradient(int k) const { return {dx[k], dy[k], dz[k]}; }
};

/// Values and exact first derivatives at x. False when the support of x is not sound (fewer nodes than basis functions,
/// a moment matrix worse conditioned than the spheres allow, or an enriched basis that extrapolates), even after trying
/// radii grown by 1.25 up to four times at this point. The support is in ascending order of nodes. Where the enriched
/// basis, or the one with ramps, has no sound support the linear one takes its place.
bool evaluate(const Spheres& spheres, const Vector3& x, ShapeFunctions& out);

/// The same at many points; out[i] belongs to points[i]. False when any support is not sound; the first such point is
/// then the first out[i] without nodes.
bool evaluate(const Spheres& spheres, std::span<const Vector3> points, std::span<ShapeFunctions> out);

/// Values, exact first and second derivatives at x. Throws InputError where a cut is to be seen by another rule than
/// `visibility`: those that bend around the front have no second derivatives, nor have ramps beside a face.
bool evaluate_second(const Spheres& spheres, const Vector3& x, ShapeFunctions& out);

} // namespace spherecut::solvers
