// The system of equations of a cut body: the factored stiffness K0 of the uncut body, bordered by what a cut appends,
//
//   [K0   Ke ]      S = Kee - Ke^T K0^-1 Ke = Kee - W^T W,   W = L^-1 Ke,   K0 = L L^T.
//   [Ke^T Kee]
//
// An increment of the cut adds columns to W and rows to S; what is there stays. Held shares of the surface that the cut
// parts are held in each part for itself: that adds P f (m1 - m2)(m1 - m2)^T to the penalty of the whole share, by one
// multiplier q a component,
//
//   [K  d          ] [u]   [f    ]
//   [d^T -1/(P f)  ] [q] = [g1-g2],   d = m1 - m2.
#pragma once

#include "solvers/appended/cut_space.hpp"
#include "solvers/appended/uncut_body.hpp"

#include <map>

namespace spherecut::solvers {

/// A linear functional of the displacement, one value an axis: sum of weight_j alpha_j + sum of M_k c_k over nodes j
/// and appended functions k.
struct CutFunctional {
  std::vector<std::pair<int, double>> base; // by node, ascending
  std::vector<std::pair<int, Matrix3>> cut; // by place of the function, ascending
};

/// Columns of loads, or of solutions: rows of the base in node order, then of the appended functions.
struct CutVectors {
  MatrixX base, cut;
  MatrixX multipliers; // right-hand sides g1 - g2 of parted shares, or the q that answer to them
};

class CutSystem {
 public:
  CutSystem(const UncutBody& uncut, const CutSpace& space)
      : uncut_(uncut), space_(&space), half_(3 * uncut.size(), 0), parted_half_(3 * uncut.size(), 0) {}

  /// What `other` is, on a space that is a copy of its own.
  CutSystem(const CutSystem& other, const CutSpace& space) : CutSystem(other) { space_ = &space; }

  /// Follows the space. `loose`: lists of twins, each of those that carry one piece that nothing holds; six soft
  /// springs hold its rigid motions. They stay without load under loads in balance.
  void update(const CutSpace::Change& change, const std::vector<std::vector<int>>& loose = {});

  /// Zero loads of so many cases.
  [[nodiscard]] CutVectors zero(Eigen::Index cases) const;
  /// Adds a force (N) on a functional to a case.
  static void add_force(const CutFunctional& on, const Vector3& force, Eigen::Index load_case, CutVectors& loads);
  [[nodiscard]] CutVectors solve(const CutVectors& loads) const;
  /// Half solutions of loads: what they do to each other is base^T base + cut^T cut - multipliers^T multipliers.
  [[nodiscard]] CutVectors half_solutions(const CutVectors& loads) const;
  /// The same where the base rows are half solutions of the uncut body already.
  void finish_halves(CutVectors& half) const;
  [[nodiscard]] static MatrixX compliance(const CutVectors& a, const CutVectors& b);

  /// Mean over weighted points (weights add up to one) with the functions as they are now.
  /// Twins that hardly weigh are left out, as are their spheres, except where something is held: then they are kept, as
  /// the uncut body has them.
  enum class Faint { left_out, kept };
  [[nodiscard]] CutFunctional mean_over(const std::vector<QuadraturePoint>& points,
                                        Faint faint = Faint::left_out) const;
  [[nodiscard]] static Vector3 value(const CutFunctional& functional, const VectorX& base, const VectorX& cut);

  /// Means of what each prescribed entry of the uncut body holds.
  [[nodiscard]] const std::vector<CutFunctional>& held() const { return held_; }
  /// Right-hand sides g1 - g2 of the parted shares, for a prescribed displacement given point by point, and the
  /// constraint forces that they add to entry k for solutions q.
  [[nodiscard]] VectorX parted_values(const std::function<Vector3(const Vector3&)>& field) const;

  /// Elastic forces, without penalties, of coefficients: K u.
  [[nodiscard]] CutVectors elastic_forces(const VectorX& base, const VectorX& cut) const;
  /// Penalties and multipliers of everything that is held times a solution, less the prescribed values.
  void subtract_holding(const VectorX& base, const VectorX& cut, const VectorX& prescribed,
                        const std::function<Vector3(const Vector3&)>& field, CutVectors& rows) const;

  /// Parts in which the k-th function does not vanish, ascending; of a step once for each of its samples.
  [[nodiscard]] const std::vector<PartId>& parts_of(int k) const { return data_[k].parts; }
  [[nodiscard]] int functions() const { return static_cast<int>(data_.size()); }
  [[nodiscard]] long stored() const { return static_cast<long>(half_.size() + schur_.size()); }

 private:
  CutSystem(const CutSystem&) = default;

  /// Of one appended function.
  struct FunctionData {
    int id = -1;
    bool is_front = false;
    bool is_sampled = false;                      // an entry for each sample of a part, else for each part
    std::vector<PartId> parts;                    // ascending, of every entry
    std::vector<double> gradients;                // per entry: 3 of a twin; 27 of a front group, [mode][i][j] du_i/dx_j
    std::vector<int> nodes;                       // base nodes that it couples with, ascending
    std::vector<Matrix3> blocks;                  // elastic, rows: components of the base
    std::vector<std::pair<int, Matrix3>> penalty; // by node: what held means add
    [[nodiscard]] int stride() const { return is_front ? 27 : 3; }
  };
  /// A difference of means over two parts of one held share.
  struct PartedShare {
    int entry = -1;
    double stiffness = 0; // N/m, P f
    CutFunctional difference;
    std::vector<QuadraturePoint> first, second;
  };
  void evaluate(int first_new);
  void evaluate_twin(int function, FunctionData& data) const;
  void add_elastic(int first_new);
  void add_held(int first_new, const CutSpace::Change& change);
  void part_held_shares();
  void add_springs(const std::vector<std::vector<int>>& loose);
  void factor(Eigen::Index unchanged);
  void solve_multipliers();
  struct CellProducts;
  void add_cell(int cell, std::span<const int> fresh, CellProducts& work);
  void list_cell(int cell, std::span<const int> fresh, CellProducts& work) const;
  void gather_gradients(const BoxShapes& cell, CellProducts& work) const;
  static void multiply_twins(const BoxShapes& cell, CellProducts& work);
  void gather_groups(CellProducts& work) const;
  void multiply_groups_with_twins(CellProducts& work) const;
  void distribute(int cell, const CellProducts& work);

  const UncutBody& uncut_;
  const CutSpace* space_;
  std::vector<FunctionData> data_;
  std::vector<std::vector<int>> in_cell_; // functions by cell, ascending
  std::vector<CutFunctional> held_;
  std::vector<char> held_touched_;         // some function reaches into the share
  std::vector<std::vector<int>> carriers_; // nodes of every function
  std::vector<PartedShare> parted_;
  MatrixX elastic_;           // of Kee, without penalties
  MatrixX penalty_;           // of Kee
  bool has_left_out_ = false; // the factor has unknowns that repeat others
  MatrixX springs_;           // rows of Kee, a column a spring of stiffness 1 N/m
  MatrixX half_;              // W, base rows in elimination order; with room for more columns
  MatrixX schur_;             // S, then its lower Cholesky factor in `lower_`
  MatrixX lower_;
  MatrixX parted_half_, parted_schur_, parted_lower_; // L^-1 d, L_S^-1 of what is appended, factor of what is left
};

} // namespace spherecut::solvers
