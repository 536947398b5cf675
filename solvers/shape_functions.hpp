// Moving least squares shape functions on spheres of influence [De 2001, Eqs. 2 and 3].
#pragma once

#include "solvers/nodes.hpp"

#include <span>

namespace spherecut::solvers {

enum class Basis { linear, quadratic }; // P = {1, x, y, z} or all monomials up to degree two

/// Quartic spline weight, 1 - 6 s^2 + 8 s^3 - 3 s^4 for s = r / R < 1, else 0.
double quartic_spline(double s);

/// The spheres of a node cloud with a search grid. Immutable once built; queries are thread safe.
class Spheres {
 public:
  /// Radii rho * h. Where the support of a node (the nodes whose spheres hold it) has fewer than basis + 2 members or a
  /// moment matrix worse conditioned than `worst_condition`, the spheres around it grow by 1.25 until it is sound.
  /// Throws NumericalError naming the node when six steps do not help.
  Spheres(std::vector<Vector3> centres, const std::vector<double>& spacings, double rho, Basis basis = Basis::linear,
          double worst_condition = 1e9);

  [[nodiscard]] int size() const;
  [[nodiscard]] const std::vector<Vector3>& centres() const;
  [[nodiscard]] const std::vector<double>& radii() const; // m
  [[nodiscard]] Basis basis() const;
  [[nodiscard]] int grown() const; // spheres that had to grow
  /// Ids of every sphere that may hold x, ascending; a superset of those that do.
  [[nodiscard]] std::span<const int> candidates(const Vector3& x) const;

 private:
  std::vector<Vector3> centres_;
  std::vector<double> radii_;
  Basis basis_;
  int grown_ = 0;
  Vector3 origin_;
  double cell_ = 1;
  std::array<int, 3> cells_{1, 1, 1};
  std::vector<int> start_, members_; // compressed rows: members_[start_[c] .. start_[c+1])
};

/// Shape functions at one point; arrays have one entry per supporting node. Reuse the object: it keeps its memory.
struct ShapeFunctions {
  std::vector<int> nodes;
  std::vector<double> value;                        // h_j(x)
  std::vector<double> dx, dy, dz;                   // gradient, 1/m
  std::vector<double> dxx, dyy, dzz, dxy, dxz, dyz; // 1/m2, filled by evaluate_second alone
  double moment_condition = 0;                      // 1-norm condition of the scaled moment matrix
  [[nodiscard]] int size() const { return static_cast<int>(nodes.size()); }
  [[nodiscard]] Vector3 gradient(int k) const { return {dx[k], dy[k], dz[k]}; }
};

/// Values and exact first derivatives at x. False when the support of x is not sound (too few nodes or singular moment
/// matrix), even after trying radii grown by 1.25 up to four times at this point.
bool evaluate(const Spheres& spheres, const Vector3& x, ShapeFunctions& out);

/// Values, exact first and second derivatives at x.
bool evaluate_second(const Spheres& spheres, const Vector3& x, ShapeFunctions& out);

} // namespace spherecut::solvers
