// What the weak form and the cell balance share: checks of the problem, nodal supports, evaluation of fields.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "solvers/shapes/functions.hpp"

#include <memory>

namespace spherecut::solvers {

/// Condition of a moment matrix beyond which a support is not sound. On the rim of a wound in a thin wedge of tissue,
/// with little but lip nodes of one plane in sight, it comes to 3e8, and shape functions to gradients of 1e4 per
/// spacing.
inline constexpr double worst_moment_condition = 1e7;

/// Shape functions at every node in compressed rows: support of node i is entries start[i] .. start[i+1].
struct NodalSupports {
  std::vector<int> start;
  std::vector<int> nodes;
  std::vector<double> value;
  std::vector<Vector3> gradient; // 1/m
  double worst_moment_condition = 0;
  /// u_h(x_i), 3 a node, m.
  [[nodiscard]] VectorX displacements(const Field& field) const;
};

/// Evaluates the shape functions at all nodes. Throws NumericalError naming the node whose support is not sound.
NodalSupports nodal_supports(const Spheres& spheres);

/// Throws InputError for bad material, fewer than 4 nodes, arrays of unequal length, non-finite positions, a
/// prescribed node out of range, a component prescribed twice, or nothing prescribed (the body would float: 6 rigid
/// motions).
void check_problem(const Problem& problem);

/// Stress of isotropic linear elasticity from the displacement gradient, Pa.
Matrix3 stress_from_gradient(const Material& material, const Matrix3& gradient);

/// Stress that the initial strain of the loads leaves behind where the body does not deform, with its sign turned:
/// sigma = C strain - initial_stress, Pa. Outside the regions, or in the given material.
Matrix3 initial_stress(const Problem& problem);
Matrix3 initial_stress(const Problem& problem, const Material& material);

/// Throws InputError that tells what takes one material alone where the problem has regions.
void require_one_material(const Problem& problem, std::string_view what);

/// How the spheres of a method reach around the cut of a problem. Near incompressibility the enrichment reaches
/// farther, as the supports of the weak form do: at nu = 0.49 a reach of 1.75 spacings leaves 3.0 % of a penny's volume
/// and 7.6 % of its K wrong, one of 2.5 leaves 1.0 and 2.3 %; at nu = 0.3 the shorter one is as right (K of a straight
/// crack in mode II 0.3 against 1.6 %). The weak form does with 1.35. Where nodes near the front see too few others for
/// the enriched basis the spheres of collocation grow, because its stresses are those at points; the weak form leaves
/// that to the points.
Sight sight_about_cut(const Problem& problem, Method method, SightRule rule);

/// Force of each pattern on each node's coefficients, sum of h_j(x) f over its points: 3N rows, a column a pattern.
/// Throws NumericalError at a point without a sound support.
MatrixX pattern_loads(const Spheres& spheres, const std::vector<ForcePattern>& patterns);

/// Shape functions at x. Throws InputError when no support covers it.
void require_support(const Spheres& spheres, const Vector3& x, ShapeFunctions& shape);

/// Everything at a point whose shape functions and material are known.
PointState state_from(const Problem& problem, const Material& material, const ShapeFunctions& shape,
                      const Field& field);

/// Shared part of the two finite-sphere discretisations.
class ElasticBody : public Discretisation {
 public:
  [[nodiscard]] const Problem& problem() const override { return problem_; }
  [[nodiscard]] const AssemblyReport& report() const override { return report_; }
  [[nodiscard]] VectorX nodal_displacements(const Field& field) const override;
  [[nodiscard]] PointState at(const Vector3& x, const Field& field) const override;
  void shape_at(const Vector3& x, ShapeFunctions& shape) const override { require_support(spheres_, x, shape); }
  [[nodiscard]] double sphere_radius(int node) const override {
    require_nodes({node});
    return spheres_.radii()[node];
  }
  [[nodiscard]] std::vector<Vector3> constraint_points() const override;
  [[nodiscard]] Vector3 contact_point(int node) const override {
    require_nodes({node});
    return problem_.nodes.positions[node];
  }
  [[nodiscard]] MatrixX contact_displacements(const std::vector<int>& nodes,
                                              const std::vector<Field>& fields) const override;
  [[nodiscard]] MatrixX pattern_displacements(const std::vector<ForcePattern>& patterns,
                                              const std::vector<Field>& fields) const override;

 protected:
  /// Radii are rho times the `lengths` of the nodes, around a cut as sight_about_cut has it; the reach of an enrichment
  /// is measured in `lengths` as well.
  ElasticBody(Problem problem, Method method, double rho, SightRule rule,
              std::vector<double> NodeCloud::*lengths = &NodeCloud::spacings);
  Problem problem_;
  AssemblyReport report_;
  Spheres spheres_;
  NodalSupports supports_;
};

/// Prescribed displacements as one vector, 3 per entry; `values` in place of the problem's own when given.
VectorX prescribed_values(const Problem& problem);
VectorX prescribed_values(const Problem& problem, const std::vector<Vector3>& values);

/// The components of `value` that the entry constrains, zero in the others.
Vector3 held_part(const Prescribed& entry, const Vector3& value);

/// Throws InputError when the problem has no domain; only `published` does without.
void require_domain(const Problem& problem);

/// Throws NumericalError when the condition estimate says that the factored matrix is singular to rounding.
void require_regular(const AssemblyReport& report);

/// Throws NumericalError when the field holds a number that is not finite.
void require_finite(const Field& field, const AssemblyReport& report);

/// Wall clock since construction, s.
class Stopwatch {
 public:
  Stopwatch();
  [[nodiscard]] double seconds() const;

 private:
  long long start_;
};

std::unique_ptr<Discretisation> make_collocation(Problem problem, const DiscretisationOptions& options);
std::unique_ptr<Discretisation> make_galerkin(Problem problem, const DiscretisationOptions& options);

} // namespace spherecut::solvers
