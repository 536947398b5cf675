// Method galerkin on a body whose cut only appends: the uncut body keeps its shape functions and its factor for good,
// and a cut adds unknowns to it. Nodes of kind lip have no spheres: they are places on the faces of the cut, where lips
// touch and openings are told. They come after all other nodes.
#pragma once

#include "solvers/appended/kept_places.hpp"

#include <memory>
#include <string>
#include <unordered_map>

namespace spherecut::solvers {

/// How many of the nodes come before the first lip node. Throws InputError where another node comes after one.
int base_nodes(const NodeCloud& nodes);

class AppendedBody final : public Discretisation {
 public:
  /// Throws as discretise().
  AppendedBody(const Problem& problem, const DiscretisationOptions& options);
  /// On an uncut body that is there already.
  AppendedBody(Problem problem, const DiscretisationOptions& options, std::shared_ptr<const UncutBody> uncut);
  AppendedBody& operator=(const AppendedBody&) = delete;

  /// One like this, to grow while this one stays as it is.
  [[nodiscard]] std::unique_ptr<AppendedBody> copy() const;
  /// The body follows its cut to `grown`: what problem() becomes when `change` (ids as they are now, added nodes at the
  /// end) and the new incision are put in; its loads are those of before. Returns why the body cannot follow and is as
  /// it was; empty: it has followed. Throws as discretise(); the body is then of no more use.
  [[nodiscard]] std::string grow(const SprinkleIncrement& change, Problem grown);

  [[nodiscard]] Method method() const override { return Method::galerkin; }
  [[nodiscard]] const Problem& problem() const override { return problem_; }
  [[nodiscard]] const AssemblyReport& report() const override { return report_; }
  /// The uncut body was factored before: none of that is time of what is reported next.
  void forget_factor_seconds() { report_.factor_seconds = 0; }
  [[nodiscard]] const std::shared_ptr<const UncutBody>& uncut() const { return uncut_; }
  [[nodiscard]] const CutSpace& space() const { return *space_; }
  [[nodiscard]] int sphere_count() const override { return uncut_->size(); }
  [[nodiscard]] int coefficient_count() const override {
    return 3 * (uncut_->size() + static_cast<int>(space_->functions().size()));
  }

  [[nodiscard]] Field solve() const override;
  [[nodiscard]] double load_work(const Field& field) const override;
  [[nodiscard]] std::vector<Field> force_responses(const std::vector<int>& candidates) const override;
  [[nodiscard]] std::vector<Field> case_responses(const std::vector<int>& nodes, const MatrixX& forces) const override;
  [[nodiscard]] CaseResponses condense_cases(const std::vector<int>& nodes, const MatrixX& forces,
                                             const std::vector<int>& at) const override;
  [[nodiscard]] MatrixX contact_compliance(const std::vector<int>& candidates) const override;
  [[nodiscard]] MatrixX compliance_between(const std::vector<int>& at, const std::vector<int>& forced) const override;
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
  void visit_weak_points(const BoundingBox& region, const std::function<bool(const Vector3& x)>& is_wanted,
                         const PointVisitor& visit) const override;
  [[nodiscard]] double sphere_radius(int node) const override;
  [[nodiscard]] std::vector<Vector3> constraint_forces(const Field& field) const override;
  [[nodiscard]] double residual(const Field& field, const std::vector<int>& loaded_nodes,
                                const std::vector<Vector3>& nodal_forces) const override;

  /// Intensities of every mode along the front, from what the front functions amount to at the nearest stations, Pa
  /// sqrt(m). Throws InputError where there are none.
  [[nodiscard]] Vector3 front_intensities(const Field& field, const topology::FrontFrame& front) const;

 private:
  AppendedBody(const AppendedBody& other);
  [[nodiscard]] KeptPlaces::IsDropped dropped_places() const;
  void follow(const BoundingBox& region);
  void find_pieces();
  void add_force(const Vector3& x, const Vector3& force);
  void shape_in_part(const BoxShapes& cell, PartId part, int lane, int sample, const Vector3& x,
                     ShapeFunctions& shape) const;
  [[nodiscard]] VectorX volume_loads_of_uncut() const;
  void add_volume_loads_of_cut();
  [[nodiscard]] Vector3 twin_load(int k, const Matrix3& initial) const;
  void assemble_loads();
  [[nodiscard]] CutFunctional value_at(const Vector3& x) const;
  [[nodiscard]] bool is_dropped(PartId part) const { return !dropped_.empty() && dropped_[components_.of(part)] != 0; }
  [[nodiscard]] CutVectors split(const VectorX& coefficients) const;
  [[nodiscard]] std::vector<Field> fields_of(const CutVectors& solutions) const;
  [[nodiscard]] CutVectors unit_forces(const std::vector<int>& nodes) const;
  [[nodiscard]] CutVectors case_forces(const std::vector<int>& nodes, const MatrixX& forces) const;
  [[nodiscard]] Field solved(const CutVectors& loads, const VectorX& prescribed,
                             const std::function<Vector3(const Vector3&)>& field, double load_factor) const;
  /// Of the entries that hold the uncut body, from those of the problem.
  [[nodiscard]] VectorX base_prescribed(const VectorX& prescribed) const;

  Problem problem_;
  DiscretisationOptions options_;
  AssemblyReport report_;
  std::shared_ptr<const UncutBody> uncut_;
  std::unique_ptr<CutSpace> space_;
  std::unique_ptr<CutSystem> system_;
  std::vector<std::vector<int>> loose_; // twins of each piece that nothing holds
  std::vector<char> dropped_;           // by component of the cut; empty: none
  CutBoxes::Components components_;
  CutVectors loads_;
  VectorX uncut_loads_; // body force and initial stress on the functions of the uncut body; empty: not known
  std::unordered_map<int, Vector3> twin_loads_; // N, the same on twins, by CutFunction::id
  std::unique_ptr<KeptPlaces> places_;          // what they keep is found as it is asked for
};

/// A body of method galerkin with rule `appended`, on `uncut` where that fits its nodes (else, or where it is null, on
/// a new one, which it becomes). Throws as discretise().
std::unique_ptr<Discretisation> make_appended(Problem problem, const DiscretisationOptions& options,
                                              std::shared_ptr<const UncutBody>& uncut);

} // namespace spherecut::solvers
