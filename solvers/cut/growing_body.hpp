// A discretisation whose cut grows: a GrowingCut behind the interface that contact, lips and output work with. Nodes
// that the cut has removed leave no holes: ids are those of the nodes present, in their order, added ones at the end.
#pragma once

#include "solvers/body/elastic_body.hpp"
#include "solvers/cut/growing_cut.hpp"

namespace spherecut::solvers {

/// What came of an increment.
struct BodyGrowth {
  const char* uncovered = ""; // why the body cannot follow the cut and is as it was; empty: it has followed
  GrowthReport update;
};

/// A body that can follow its cut.
class Growable {
 public:
  virtual ~Growable() = default;
  /// The body follows the cut to `grown`: what problem() becomes when `change` (ids as they are now, added nodes at the
  /// end) and the new incision are put in. A piece that comes free is not covered. Throws as GrowingCut::grow; the body
  /// is then as it was. With `only_update` what the window does not cover is uncovered too, and not condensed anew.
  virtual BodyGrowth grow(const SprinkleIncrement& change, Problem grown,
                          const std::function<topology::SurfaceMesh()>& way_ahead = {}, bool only_update = false) = 0;
};

/// One of method galerkin or collocation with a window along options.way, which is Growable. Throws as discretise(),
/// and InputError where the method is another, a candidate does not exist, the way is empty, or a severed piece leaves
/// the computation (UnheldPieces::drop).
std::unique_ptr<Discretisation> make_growable(Problem problem, GrowthOptions options);

/// Of method galerkin.
class GrowingBody final : public Discretisation, public Growable {
 public:
  /// As discretise() in method galerkin, with a window along options.way (growing_cut.hpp). Throws as GrowingCut, and
  /// InputError where a severed piece leaves the computation (UnheldPieces::drop).
  GrowingBody(Problem problem, GrowthOptions options);

  BodyGrowth grow(const SprinkleIncrement& change, Problem grown,
                  const std::function<topology::SurfaceMesh()>& way_ahead = {}, bool only_update = false) override;

  [[nodiscard]] Method method() const override { return Method::galerkin; }
  [[nodiscard]] const Problem& problem() const override { return problem_; }
  /// Pieces are told by which nodes see each other; seconds are those of the last increment, the condition is that of
  /// the last condensation.
  [[nodiscard]] const AssemblyReport& report() const override { return report_; }
  [[nodiscard]] const GrowingCut& system() const { return *cut_; }

  [[nodiscard]] Field solve() const override;
  [[nodiscard]] double load_work(const Field& field) const override;
  [[nodiscard]] std::vector<Field> force_responses(const std::vector<int>& candidates) const override;
  [[nodiscard]] std::vector<Field> case_responses(const std::vector<int>& nodes, const MatrixX& forces) const override;
  /// Without fields.
  [[nodiscard]] CaseResponses condense_cases(const std::vector<int>& nodes, const MatrixX& forces,
                                             const std::vector<int>& at) const override;
  /// That of the candidates in GrowthOptions::contact is there after every increment; others cost a solution each.
  [[nodiscard]] MatrixX contact_compliance(const std::vector<int>& candidates) const override;
  [[nodiscard]] std::vector<Field> pattern_responses(const std::vector<ForcePattern>& patterns) const override;
  [[nodiscard]] MatrixX pattern_displacements(const std::vector<ForcePattern>& patterns,
                                              const std::vector<Field>& fields) const override;
  [[nodiscard]] Field prescribed_response(const std::vector<Vector3>& values) const override;
  [[nodiscard]] std::vector<Vector3> constraint_points() const override;
  [[nodiscard]] Vector3 contact_point(int node) const override;
  [[nodiscard]] MatrixX contact_displacements(const std::vector<int>& nodes,
                                              const std::vector<Field>& fields) const override;
  [[nodiscard]] VectorX nodal_displacements(const Field& field) const override;
  [[nodiscard]] PointState at(const Vector3& x, const Field& field) const override;
  void shape_at(const Vector3& x, ShapeFunctions& shape) const override;
  [[nodiscard]] double sphere_radius(int node) const override {
    require_nodes({node});
    return cut_->spheres().radii()[id_[node]];
  }
  [[nodiscard]] std::vector<Vector3> constraint_forces(const Field& field) const override;
  /// From the stiffness as the cells make it, not from the window that was updated.
  [[nodiscard]] double residual(const Field& field, const std::vector<int>& loaded_nodes,
                                const std::vector<Vector3>& nodal_forces) const override;

 private:
  void number_nodes();
  /// Between coefficients of the present nodes and those of all the system knows.
  [[nodiscard]] MatrixX expanded(const MatrixX& present) const;
  [[nodiscard]] MatrixX compacted(const MatrixX& all) const;
  [[nodiscard]] VectorX solved(const VectorX& loads, const VectorX& prescribed) const;
  [[nodiscard]] Vector3 constraint_force(std::size_t k, const VectorX& coefficients, const VectorX& prescribed) const;
  [[nodiscard]] VectorX holding_forces(const VectorX& coefficients, const VectorX& prescribed) const;
  [[nodiscard]] std::vector<Field> responses_to(const MatrixX& forces) const;
  [[nodiscard]] MatrixX case_forces(const std::vector<int>& nodes, const MatrixX& forces) const;
  [[nodiscard]] MatrixX unit_forces(const std::vector<int>& nodes) const;

  Problem problem_;
  AssemblyReport report_;
  std::unique_ptr<GrowingCut> cut_;
  std::vector<int> id_;      // in the system, of every node
  std::vector<int> compact_; // back; -1: removed
  NodalSupports supports_;
};

} // namespace spherecut::solvers
