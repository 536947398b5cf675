// The body at one moment of a run: its cut, nodes, assembled system and solution. Everything that a cut replaces, so
// that a refused cut leaves the old one standing.
#pragma once

#include "solvers/body/elastic_body.hpp"
#include "solvers/contact/lip_contact.hpp"
#include "solvers/finite/cut_lineage.hpp"
#include "solvers/fracture/tearing.hpp"
#include "src/model/rest_memo.hpp"
#include "src/model/surface_watch.hpp"
#include "src/scenario/scenario.hpp"

#include "topology/blade/blade.hpp"
#include "topology/tool/contact.hpp"

#include <optional>

namespace spherecut::solvers {
class UncutBody;
} // namespace spherecut::solvers

namespace spherecut::app {

/// Spacings: banks of the surface that come so near to each other are looked at together.
inline constexpr double near_banks = 0.25;

class FiniteModel; // src/model/finite_model.hpp

/// How spheres reach around a cut: cut.sight, or where it is left out `appended` for cuts at finite strain that do not
/// tear, and the method's own elsewhere.
solvers::SightRule sight_of(const Scenario& scenario);

/// Whether a cut of this scenario's body only appends unknowns (sight rule `appended`).
bool cut_appends(const Scenario& scenario);

struct BodyModel {
  std::shared_ptr<const topology::Incision> incision; // null: uncut
  solvers::Sprinkling sprinkling;
  double coarseness = 1;               // of its spacings, in those of the scenario
  std::optional<Vector3> touched_from; // solvers::Problem::touched_from
  std::vector<solvers::LipPair> pairs; // of the cut
  std::vector<solvers::LipPair> banks; // of the organ's own surface where it has come to itself
  /// Where the surface reaches deepest through itself in the last solution.
  struct PassedThrough {
    double depth = 0;                // m, 0: nowhere
    Vector3 place = Vector3::Zero(); // m, at rest
    double spacing = 0;              // m, of the node there
  };
  PassedThrough passed_through;
  std::unique_ptr<solvers::Discretisation> body;   // null before the first load, touch or cut, and at finite strain
  std::shared_ptr<FiniteModel> finite;             // in place of the body where the law is not linear
  std::shared_ptr<const solvers::UncutBody> uncut; // of a body whose cut only appends; it may serve the next one
  solvers::CutLineage lineage;                     // the same at finite strain
  solvers::Field base;                             // without tool and contact
  solvers::ContactPatch patch;                     // no nodes: the tool is far
  std::optional<SurfaceWatch> watch;               // of the surface about the patch; empty: not looked at yet
  int presses = 0;                                 // since it was condensed
  std::optional<solvers::LipPatch> lips;           // pairs, then banks; empty: none has had to be held yet
  std::optional<solvers::CutContactState> state;   // empty: not solved yet
  solvers::Field field;                            // solution; at finite strain of that body's shape functions
  std::optional<solvers::Field> without_blade;     // that without the blade, while `field` is under it
  mutable solvers::FrontRules front_rules{};       // of these nodes and this cut, found as they are asked for
  mutable RestMemo rest_memo{};                    // of the solution, likewise

  /// Whether there is a body.
  [[nodiscard]] bool built() const { return body != nullptr || finite != nullptr; }
  /// Its nodes, those that have a sphere first; their number; the radius of a node's sphere, m, 0 where it has none;
  /// and how many coefficients its field has. Of a body that is built.
  [[nodiscard]] const solvers::NodeCloud& nodes() const;
  [[nodiscard]] int sphere_count() const;
  [[nodiscard]] double sphere_radius(int node) const;
  [[nodiscard]] int coefficient_count() const;
  /// Whether there is a solution.
  [[nodiscard]] bool solved() const;
  /// Displacement of every node, 3 a node, m; of a model that is solved.
  [[nodiscard]] VectorX nodal_displacements() const;
  /// Displacement and stress at a point of the body; beyond every sphere those at the nearest node that sees it. At
  /// rest before the first solution.
  [[nodiscard]] solvers::PointState at(const Vector3& x) const;
  /// Shape functions there, with which the displacement is a sum over nodes; of a body that is built.
  void shape_at(const Vector3& x, solvers::ShapeFunctions& shape) const;
  /// Nearest node that sees x; 0 where none does.
  [[nodiscard]] int nearest_seen(const Vector3& x) const;
};

/// Whether a node of this kind is one of the organ's own surface, for a tool to touch.
inline bool on_surface(solvers::NodeKind kind) {
  return kind == solvers::NodeKind::surface || kind == solvers::NodeKind::edge;
}

/// Nodes of the fixed regions with the components that are held: an entry for every set of axes that are held by the
/// same regions. Throws InputError naming the region that holds none.
std::vector<solvers::Prescribed> fixed_nodes(const Scenario& scenario, const topology::Domain& domain,
                                             const solvers::NodeCloud& nodes);

/// How many nodes these entries of fixed_nodes() hold.
int held_nodes(const std::vector<solvers::Prescribed>& prescribed);

/// Axes along which each of `count` nodes is held by any of the entries.
std::vector<std::array<bool, 3>> held_axes(const std::vector<solvers::Prescribed>& prescribed, int count);

/// Whether a force along the unit vector `normal` moves a node that is held along some axes.
bool gives_way(const std::array<bool, 3>& held, const Vector3& normal);

/// Surface nodes that a tool at `centre` may touch: within `reach` m on its side of the organ, without those that are
/// held against it. Throws InputError when there are none.
std::vector<int> touchable_nodes(const Scenario& scenario, const topology::Domain& domain,
                                 const solvers::NodeCloud& nodes, const topology::SurfaceContact& centre, double reach);

/// Nodes for `options` in place of `previous`, as solvers::resprinkle. A fixed region that would be left without a
/// surface node keeps those that it had. Throws as that does.
solvers::Sprinkling resprinkle_held(const Scenario& scenario, const topology::Domain& domain,
                                    const solvers::SprinkleOptions& options, const solvers::NodeCloud& previous);

/// What a body on the nodes and the incision of a model is made of: regions held and loads, as the scenario has them.
solvers::Problem problem_of(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                            const BodyModel& model);

/// Assembles and factors the body of a scenario on the model's nodes and incision. Throws as solvers::discretise does.
void assemble(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain, BodyModel& model);

/// Reason not to follow: the body is at finite strain.
inline constexpr const char* not_linear = "the law is not linear";

/// Why nodes beside a cut cannot be exchanged alone in this scenario, on the nodes of `model`; empty: they can.
std::string hindrance_to_growth(const Scenario& scenario, const BodyModel& model, bool severed);

/// What a cut changes in the nodes of `before`: those beside the new part of the cut are exchanged, the others keep
/// their order. Throws as solvers::extend_sprinkling does.
solvers::SprinkleIncrement exchange_nodes(const topology::Domain& domain, const solvers::SprinkleOptions& options,
                                          const BodyModel& before, solvers::Sprinkling& after);

/// A copy of a body whose cut only appends, for follow_cut() to take; null: the model has none.
std::unique_ptr<solvers::Discretisation> body_to_grow(const BodyModel& model);

/// Such a copy follows the cut to the nodes and incision of `after` and becomes its body. Where it cannot, `after` has
/// none. Returns why; empty: it has followed. Throws as solvers::AppendedBody::grow does.
std::string follow_cut(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                       const solvers::SprinkleIncrement& change, std::unique_ptr<solvers::Discretisation> body,
                       BodyModel& after);

/// Condenses the model onto tool candidates; none: the tool is far. Forgets the state. `for_few_presses`: without the
/// fields of the patch where the method can do without (contact_solver.hpp).
void condense(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses = false);

/// Finds, for a condensed model, the means over lips that every solve of it takes, so that the first does not have to.
/// Throws NumericalError where no sound support covers a lip: the model cannot be solved.
void find_lips(BodyModel& model);

/// Presses on a patch without fields after which they are made, a few candidates a press.
inline constexpr int few_presses = 20;

/// Solves for tool and lips in contact; `tool` null: the tool is far, and candidates there are none. Starts from the
/// model's state where it has one. With `grasped`, one displacement (m) a node of the patch, the tool does not press:
/// it holds the patch there. A model without state goes on from the `memory` of friction on other nodes, if there is
/// one. `lips_touch`: lips have to be held as a rule, and are condensed without being tried apart.
void solve_contact(const ToolSettings* tool, const topology::ToolPose* pose, const Scenario& scenario, BodyModel& model,
                   const std::vector<Vector3>* grasped = nullptr,
                   const std::optional<solvers::GripMemory>& memory = std::nullopt, bool lips_touch = false);

/// Largest unbalanced force over the largest force.
double residual(const BodyModel& model);

/// Openings of the pairs along their normals, m.
std::vector<double> normal_openings(const BodyModel& model);

} // namespace spherecut::app
