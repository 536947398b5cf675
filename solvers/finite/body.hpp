// A body at finite strain by the method of finite spheres, total Lagrangian: strain energy, forces and tangent of a
// hyperelastic law as functions of the coefficients of its shape functions. solvers/finite/equilibrium.hpp finds its
// equilibria.
//
// Nearly incompressible laws take the pressure of the mean volume change of blocks of cells,
//
//   W = sum_q w_q [W_iso(F_q) + s U(J_q)] + (1 - s) sum_b V_b U(J_b),   J_b = sum_{q in b} w_q J_q / V_b,
//
// with a small pointwise share s that leaves no volume change within a block free.
#pragma once

#include "solvers/body/elastic_body.hpp"
#include "solvers/elasticity/prony.hpp"
#include "solvers/finite/held_means.hpp"
#include "solvers/points/consistent_gradients.hpp"
#include "solvers/points/dilatation_blocks.hpp"

#include <optional>

namespace spherecut::topology {
class PointTree;
}

namespace spherecut::solvers {

class CutFunctions;   // solvers/finite/cut_functions.hpp
class FiniteTangent;  // solvers/finite/tangent.hpp
class UncutFunctions; // solvers/finite/cut_functions.hpp

struct FiniteOptions {
  double support_radius = 1.75; // rho, radius of a sphere over the node's spacing
  double cell_size = 0.75;      // edge of a background cell in units of the spacing
  int quadrature = 2;           // rule of a cell, 1 to 3
  /// Modulus of the pointwise part of the pressure over mu: s = that times mu over the bulk modulus, at most 1. 0: the
  /// mean over blocks alone; infinity: every point has a pressure of its own.
  double pointwise_modulus = 2.5;
  std::vector<PronyTerm> prony{}; // of a viscoelastic body: its isochoric stress fades (solvers/elasticity/prony.hpp)
  bool consistent = true;         // whether the gradients are made consistent with the quadrature
  /// Only where there is an incision, but for `appended`: its points are those of small boxes with or without one, and
  /// `cell_size` and `quadrature` say nothing of them.
  SightRule sight = SightRule::enriched;
};

/// What a law says at one point of the deformed body.
struct FiniteState {
  Vector3 displacement = Vector3::Zero();    // m
  Matrix3 deformation = Matrix3::Identity(); // F
  Matrix3 first_piola = Matrix3::Zero();     // P, Pa
  Matrix3 cauchy = Matrix3::Zero();          // P F^T / J, Pa
  double jacobian = 1, energy = 0;           // energy: J per m3 of the stress-free body
};

/// Energy of a body and its slope at some coefficients.
struct FiniteForces {
  double energy = 0;         // J; infinite where the law cannot be asked (some J <= 0)
  double least_jacobian = 1; // of all points
  VectorX forces;            // dE/du, N, 3 a function; not set where the energy is infinite
};

/// Tangent of points that are strained alike, per volume.
struct UniformTangent {
  Eigen::Matrix<double, 9, 9> stiffness; // Pa: row a + 3 b, column c + 3 d: dP_ac / dF_bd
  Matrix3 cofactor;                      // J F^-T
  double bulk_slope = 0;                 // Pa, of the part of the pressure that blocks have
};

class FiniteBody {
 public:
  /// The problem's material is replaced by the small-strain constants of the law. `fibres` gives the directions of a
  /// fibrous law point by point; null: its own. An initial strain e0 of the loads means that the body at rest is
  /// strained elastically by F_0 = I - e0 everywhere (prestrained_law.hpp); law() then is the law with it. Throws
  /// InputError for a problem that discretise() refuses, a pre-strain that prestrained() refuses, options out of their
  /// range and a missing law; NumericalError where a support is not sound. `uncut`: of a body of rule `appended`, which
  /// takes it where it fits (null: there is none yet).
  FiniteBody(Problem problem, std::shared_ptr<const Law> law, const FiniteOptions& options = {},
             const std::function<FibreFrame(const Vector3& x)>& fibres = nullptr,
             const std::shared_ptr<const UncutFunctions>& uncut = nullptr);
  ~FiniteBody();
  FiniteBody(const FiniteBody&) = delete;
  FiniteBody& operator=(const FiniteBody&) = delete;

  [[nodiscard]] const Problem& problem() const { return problem_; }
  [[nodiscard]] const Law& law() const { return *law_; }
  [[nodiscard]] const FiniteOptions& options() const { return options_; }
  [[nodiscard]] int size() const { return problem_.nodes.size(); } // nodes
  /// Vector unknowns, the coefficients of shape functions: those of the nodes' spheres, then what a cut appends.
  [[nodiscard]] int functions() const { return functions_; }
  /// The node whose sphere a function belongs to.
  [[nodiscard]] int node_of(int function) const;
  [[nodiscard]] const Spheres& spheres() const;
  /// The rule `appended`: functions on the cut; else null.
  [[nodiscard]] const CutFunctions* cut_functions() const { return cut_functions_.get(); }
  /// Shape functions at x. False: no sound support covers it. Where there is to be one, throws InputError.
  bool evaluate(const Vector3& x, ShapeFunctions& shape) const;
  void shape_at(const Vector3& x, ShapeFunctions& shape) const;
  [[nodiscard]] const PointTable& points() const { return table_; }
  [[nodiscard]] const DilatationBlocks& blocks() const { return blocks_; } // none where every point has its pressure
  [[nodiscard]] const ConsistencyReport& consistency() const { return consistency_; }
  [[nodiscard]] const HeldMeans& held() const { return *held_; }
  /// F_0, the elastic deformation of the body at rest, the same everywhere.
  [[nodiscard]] const Matrix3& prestrain() const { return prestrain_; }
  /// Coefficients of the stress-free body, with F = F_0^-1 everywhere, 3 a function, m.
  [[nodiscard]] VectorX stress_free() const;
  /// Share s of the volumetric energy that is taken point by point.
  [[nodiscard]] double pointwise_share() const { return share_; }
  [[nodiscard]] double volume() const { return volume_; } // m3, of the points
  /// Whether the law has a volumetric part: states with J <= 0 are then refused.
  [[nodiscard]] bool minds_volume() const { return law_->bulk_slope(1) > 0; }

  /// Begins a step of that many seconds from the last state that was accepted; at first one without stress, and a step
  /// of no time. Energy, forces and tangent are those of the step from then on. Nothing where the body does not fade.
  /// Throws InputError for a duration that is negative or not finite.
  void begin_step(double seconds);
  /// The state at the end of the step.
  void accept_step(const VectorX& coefficients);
  /// A state that has been held for ever is a step of as many of its longest times: nothing more than this fades.
  static constexpr double for_ever = 1e9;

  /// Forces of the problem's loads at factor 1 on the coefficients, dead, N.
  [[nodiscard]] const VectorX& loads() const { return loads_; }
  /// Means of the problem's prescribed displacements, one per entry, and of any other field, m.
  [[nodiscard]] std::vector<Vector3> prescribed_values() const;
  [[nodiscard]] std::vector<Vector3> prescribed_values(const std::function<Vector3(const Vector3& x)>& field) const;
  /// The share of the surface that a force of a tool on a surface node acts on.
  [[nodiscard]] DisplacementMean contact_mean(int node) const;
  /// The function that says most about a mean of some: how the body is strained there.
  [[nodiscard]] static int carrier_of(const DisplacementMean& mean);

  /// Strain energy and internal forces, loads and constraints left out. Coefficients: 3 a function, m. The same bits
  /// with any number of threads.
  void evaluate(const VectorX& coefficients, FiniteForces& out) const;

  /// Tangent d2E/du2 at the coefficients, its lower triangle of full 3 x 3 blocks, function i at rows 3 rank(i) .. + 2,
  /// with the penalty of the held means: `penalty` times mu times the node's spacing, N/m, for every held component.
  /// With a penalty what a cut appends has a little support of its own, so that the whole is definite.
  void tangent(const VectorX& coefficients, double penalty, SparseMatrix& lower) const;
  /// Place of every function in the order of elimination, which is found when it, or a tangent, is first asked for: not
  /// by two threads at once.
  [[nodiscard]] const std::vector<int>& rank() const;
  /// The tangent of all points where they are strained alike, as at rest, and the law is the same everywhere; else of
  /// no value.
  [[nodiscard]] std::optional<UniformTangent> uniform_tangent(const VectorX& coefficients) const;
  /// Where cuts append: for every group of points, that of the uncut body's which it is, or is part of.
  [[nodiscard]] const std::vector<int>& uncut_groups() const { return uncut_groups_; }
  [[nodiscard]] double penalty_stiffness(int entry, double penalty) const;
  /// Stiffness that holds a function where a cut appends, beside the penalty, N/m.
  [[nodiscard]] double support_of(int function) const;

  /// Map of every function that carries the rest state along: mean of F where it counts over its determinant. Identity
  /// where that is below 0.05.
  [[nodiscard]] std::vector<Matrix3> piola_maps(const VectorX& coefficients) const;

  /// Displacement of every node, u_h(x_i), 3N, m.
  [[nodiscard]] VectorX nodal_displacements(const VectorX& coefficients) const;
  /// Everything at a place of the stress-free body, with the pressure of that place's own J and what has faded at the
  /// nearest point of the quadrature. Throws InputError when no support covers x.
  [[nodiscard]] FiniteState at(const Vector3& x, const VectorX& coefficients) const;

 private:
  friend class FiniteTangent;
  friend std::optional<UniformTangent> uniform_tangent_of(const FiniteBody& body,
                                                          const std::vector<LaneValues>& deformation,
                                                          const std::vector<double>& jacobian);
  void tabulate();
  void hold();
  [[nodiscard]] DisplacementMean weighed(DisplacementMean mean) const;
  void assemble_loads();
  /// F of all groups, and the mean J of all blocks; returns the least J.
  double deform(const VectorX& coefficients) const;
  [[nodiscard]] const FiniteTangent& assembler() const;
  double add_chunk(int begin, int end, const std::vector<double>& pressure, bool one_thread, VectorX& forces) const;
  [[nodiscard]] const Vector3& place_of(int group, std::size_t point) const; // m
  [[nodiscard]] int count_from(int begin, int end) const;          // points that weigh something, of these groups
  void gradients_of(int begin, int end, Matrix3* gradients) const; // as deform() found them
  [[nodiscard]] std::span<const FibreFrame> fibres_of(int begin, int count) const;

  struct Work;

  Problem problem_;
  Matrix3 prestrain_;
  std::shared_ptr<const Law> law_;
  FiniteOptions options_;
  std::function<FibreFrame(const Vector3& x)> fibre_field_;
  std::unique_ptr<const Spheres> own_spheres_; // null by rule `appended`
  std::unique_ptr<const CutFunctions> cut_functions_;
  int functions_ = 0;
  std::unique_ptr<SurfacePatches> patches_;
  PointTable table_;
  std::vector<int> uncut_groups_;
  DilatationBlocks blocks_;
  ConsistencyReport consistency_;
  std::unique_ptr<HeldMeans> held_;
  std::vector<FibreFrame> fibres_; // of every point that weighs something, in the order of the groups; or none
  std::vector<int> point_start_;   // of every group: its first such point
  double volume_ = 0, share_ = 1;
  VectorX loads_;
  NodalSupports supports_;
  std::unique_ptr<PronyState> prony_;              // null: nothing fades
  std::unique_ptr<topology::PointTree> places_;    // of all points, where something does
  mutable std::unique_ptr<FiniteTangent> tangent_; // null: not asked for yet
  std::unique_ptr<Work> work_;
};

} // namespace spherecut::solvers
