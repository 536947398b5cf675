// Tetrahedra of an uncut body whose displacement is enriched at a cut: nodes behind the front have a displacement on
// either side of it, corners near the front go with the root of the distance as well [Moes, Dolbow & Belytschko 1999].
#pragma once

#include "experiments/remeshing_ledger/fem_model.hpp"
#include "experiments/remeshing_ledger/level_set_rules.hpp"

#include <vector>

namespace spherecut::experiments::ledger {

/// Place beside the front in the plane of the cut: ahead of it positive.
class FrontDistance {
 public:
  FrontDistance(const Scenario& scenario, int increment);
  struct Place {
    double ahead;  // m, in the plane
    double height; // m, over it
    Vector3 way;   // gradient of `ahead`
  };
  [[nodiscard]] Place at(const Vector3& x) const;

 private:
  const Scenario* scenario_;
  std::vector<Vector2> points_;
  bool closed_;
};

inline constexpr int front_functions = 4;
struct FrontFunctions {
  std::array<double, front_functions> value;
  std::array<Vector3, front_functions> gradient;
};
/// sqrt(r) times sin(t/2), cos(t/2), sin(t/2) sin t, cos(t/2) sin t, t = 0 ahead. The first jumps across the cut.
FrontFunctions front_values(const FrontDistance::Place& place, const Vector3& normal);

/// What an element does with the cut.
enum class CellState : char { whole, split, front, ahead };

/// One function of an element's displacement.
struct CellFunction {
  int node;       // of FemNodes
  int base;       // of the element's shape functions; a corner where it goes with a front function
  int sub;        // number within the node's unknowns
  int side;       // +1, -1: on that side alone; 0: everywhere
  int front = -1; // of the front functions, -1: none
};

/// Values and gradients (3 x 10) of the shape functions of a straight element.
struct ShapeValues {
  std::array<double, 10> value;
  Eigen::Matrix<double, 3, 10> gradient;
};
class StraightCell {
 public:
  StraightCell(const FemNodes& nodes, int element);
  [[nodiscard]] ShapeValues at(const std::array<double, 4>& l) const;
  [[nodiscard]] Vector3 position(const std::array<double, 4>& l) const;
  [[nodiscard]] std::array<double, 4> place(const Vector3& x) const;
  [[nodiscard]] double volume() const { return volume_; }
  [[nodiscard]] const Vector3& corner(std::size_t k) const { return corner_[k]; }
  [[nodiscard]] const Eigen::Matrix<double, 3, 4>& flat() const { return flat_; } // gradients of the coordinates

 private:
  std::array<Vector3, 4> corner_;
  Eigen::Matrix<double, 3, 4> flat_;
  bool quadratic_;
  double volume_;
};

/// Stiffness of the enriched element, 3 f + c over its functions.
MatrixX enriched_stiffness(const StraightCell& cell, const std::vector<CellFunction>& functions, const CellRule& rule,
                           const FrontDistance& front, const Scenario& scenario);

/// Points of the cut's faces within an element: its barycentric coordinates, and share of the area.
struct CutPoint {
  std::array<double, 4> place;
  double area; // m2
};
std::vector<CutPoint> cut_points(const StraightCell& cell, const Scenario& scenario,
                                 const std::vector<Vector2>& outline, CellState state);

/// Displacement above the cut less that below it, for a unit of every function.
VectorX jumps(const StraightCell& cell, const std::vector<CellFunction>& functions, const std::array<double, 4>& place,
              const FrontDistance& front);

/// Where the plane of the cut crosses the edges of an element, in order about it; empty: nowhere.
std::vector<Vector3> crossings(const StraightCell& cell, const Scenario& scenario);

} // namespace spherecut::experiments::ledger
