// Bodies at finite strain and their equilibria.
#include "python/bindings/floors.hpp"
#include "python/bindings/held.hpp"
#include "solvers/finite/equilibrium.hpp"
#include "topology/base/errors.hpp"

#include <atomic>
#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using solvers::Equilibrium;
using solvers::EquilibriumStatus;
using solvers::FiniteBody;
using solvers::FiniteState;
using solvers::Law;

/// A body for one thread at a time, and not from within the functions of its law, on whatever thread they are called.
struct LawBody {
  std::unique_ptr<FiniteBody> body;
  std::shared_ptr<Law> law;
  mutable std::mutex lock;
  mutable std::atomic<bool> is_busy{false}; // with the lock
};

struct BodyEquilibrium {
  std::shared_ptr<LawBody> body;
  std::unique_ptr<Equilibrium> equilibrium;
};

template <class Call>
auto with_law_body(const LawBody& self, Call&& call) -> decltype(call(*self.body)) {
  if (in_law_function() && self.is_busy)
    throw InputError("body: asked from within a function of its own law; allowed: bodies that nothing else works with");
  return unlocked([&] {
    const std::lock_guard guard(self.lock);
    struct Busy {
      std::atomic<bool>& flag;
      explicit Busy(std::atomic<bool>& f) : flag(f) { flag = true; }
      ~Busy() { flag = false; }
      Busy(const Busy&) = delete;
      Busy& operator=(const Busy&) = delete;
    } const busy(self.is_busy);
    return call(*self.body);
  });
}

template <class Call>
auto with_equilibrium(BodyEquilibrium& self, Call&& call) -> decltype(call(*self.equilibrium)) {
  return with_law_body(*self.body, [&](const FiniteBody&) { return call(*self.equilibrium); });
}

/// (n, 3) as 3 a node.
VectorX coefficients_from(const Doubles& array, int nodes) {
  const std::vector<Vector3> rows = points_from(array, "coefficients");
  if (std::ssize(rows) != nodes)
    throw InputError(fmt::format("coefficients: {} rows; allowed: {}, one a node", rows.size(), nodes));
  return Eigen::Map<const VectorX>(array.data(), array.size());
}

std::shared_ptr<LawBody> law_body_from(std::shared_ptr<topology::Domain> domain, const solvers::NodeCloud& nodes,
                                       std::shared_ptr<Law> law, const std::vector<Held>& held,
                                       const py::object& body_force, const py::object& traction,
                                       const py::object& lip_traction, std::shared_ptr<topology::Incision> incision,
                                       const std::string& sight, double support_radius, double cell_size,
                                       int quadrature, double pointwise_modulus) {
  solvers::Problem problem;
  problem.domain = std::move(domain);
  problem.incision = std::move(incision);
  problem.nodes = nodes;
  problem.loads = loads_from(body_force, traction, lip_traction);
  solvers::FiniteOptions options;
  options.sight = solvers::sight_rule_from_string(sight);
  options.support_radius = support_radius;
  options.cell_size = cell_size;
  options.quadrature = quadrature;
  options.pointwise_modulus = pointwise_modulus;
  return unlocked([&] {
    hold(held, problem);
    auto body = std::make_shared<LawBody>();
    body->body = std::make_unique<FiniteBody>(std::move(problem), law, options);
    body->law = std::move(law);
    return body;
  });
}

/// What a law says at n points.
struct LawValues {
  std::vector<Vector3> displacement;
  std::vector<Matrix3> deformation, first_piola, cauchy;
  std::vector<double> jacobian, energy;
};

LawValues law_values_at(const LawBody& self, const Doubles& points, const Doubles& coefficients) {
  const std::vector<Vector3> x = one_or_more_points(points, "points");
  const VectorX u = coefficients_from(coefficients, self.body->size());
  return with_law_body(self, [&](const FiniteBody& body) {
    LawValues values;
    for (const Vector3& point : x) {
      interruption_point();
      const FiniteState state = body.at(point, u);
      values.displacement.push_back(state.displacement);
      values.deformation.push_back(state.deformation);
      values.first_piola.push_back(state.first_piola);
      values.cauchy.push_back(state.cauchy);
      values.jacobian.push_back(state.jacobian);
      values.energy.push_back(state.energy);
    }
    return values;
  });
}

py::array held_of(const LawBody& self) {
  std::vector<int> nodes;
  for (const solvers::Prescribed& entry : self.body->problem().prescribed)
    nodes.push_back(entry.node);
  return owned(std::move(nodes));
}

template <class T>
auto values_member(std::vector<T> LawValues::*member) {
  return [member](const py::object& self) { return view(self.cast<const LawValues&>().*member, self); };
}

void bind_values(py::module_& module) {
  py::class_<LawValues>(module, "FiniteValues",
                        "What a body at finite strain is at n points; the arrays are its memory.")
      .def_property_readonly("displacement", values_member(&LawValues::displacement), "(n, 3), m.")
      .def_property_readonly("deformation", values_member(&LawValues::deformation), "(n, 3, 3): F.")
      .def_property_readonly("first_piola", values_member(&LawValues::first_piola), "(n, 3, 3), Pa: P = dW/dF.")
      .def_property_readonly("cauchy", values_member(&LawValues::cauchy), "(n, 3, 3), Pa: P F^T / J.")
      .def_property_readonly("jacobian", values_member(&LawValues::jacobian), "(n,): J = det F.")
      .def_property_readonly("energy", values_member(&LawValues::energy), "(n,), J/m3 of the body at rest: W.");
}

void bind_law_body(py::module_& module) {
  py::class_<LawBody, std::shared_ptr<LawBody>>(
      module, "FiniteBody",
      "A body of a Law at finite strain. Its states are coefficients, (n, 3), m, of which displacements are sums; an "
      "Equilibrium finds them. One thread works with it at a time; others wait.")
      .def(py::init(&law_body_from), "domain"_a, "nodes"_a, "law"_a, "held"_a, py::kw_only(),
           "body_force"_a = py::none(), "traction"_a = py::none(), "lip_traction"_a = py::none(),
           "incision"_a = py::none(), "sight"_a = "enriched", "support_radius"_a = 1.75, "cell_size"_a = 0.75,
           "quadrature"_a = 2, "pointwise_modulus"_a = 2.5,
           "held: list of Held. body_force: N per m3 of the body at rest, (3,) or a function of x. traction: Pa on the "
           "surface at rest, (3,) or a function of x and normal; lip_traction: the same on the faces of the cut. Loads "
           "keep their direction. sight: 'visibility', 'diffraction', 'enriched' or 'appended'. support_radius, "
           "cell_size: in spacings. quadrature: rule of a cell, 1 to 3. pointwise_modulus: of the part of the pressure "
           "that is taken "
           "point by point, over the shear modulus. Raises InputError and NumericalError as Body.")
      .def(
          "evaluate",
          [](const LawBody& self, const Doubles& coefficients) {
            const VectorX u = coefficients_from(coefficients, self.body->size());
            solvers::FiniteForces forces = with_law_body(self, [&](const FiniteBody& body) {
              solvers::FiniteForces found;
              body.evaluate(u, found);
              if (!std::isfinite(found.energy))
                found.forces.setZero(u.size());
              return found;
            });
            return std::make_pair(forces.energy, owned_by_threes(std::move(forces.forces)));
          },
          "coefficients"_a,
          "Strain energy, J, and internal forces, (n, 3), N, its slope by the coefficients; inf and zero where the law "
          "cannot be asked.")
      .def(
          "at", &law_values_at, "points"_a, "coefficients"_a,
          "FiniteValues at points of the body at rest, (n, 3), m. Raises InputError for a point that no sphere covers.")
      .def(
          "nodal_displacements",
          [](const LawBody& self, const Doubles& coefficients) {
            const VectorX u = coefficients_from(coefficients, self.body->size());
            return owned_by_threes(
                with_law_body(self, [&](const FiniteBody& body) { return body.nodal_displacements(u); }));
          },
          "coefficients"_a, "(n, 3), m, at the nodes.")
      .def_property_readonly(
          "loads", [](const LawBody& self) { return owned_by_threes(self.body->loads()); },
          "(n, 3), N: forces of the loads on the coefficients.")
      .def_property_readonly(
          "prescribed", [](const LawBody& self) { return owned(self.body->prescribed_values()); },
          "(k, 3), m: the given displacement of every entry that is held; see held_nodes.")
      .def_property_readonly("held_nodes", &held_of, "(k,): the node of every entry that is held.")
      .def_property_readonly(
          "nodes", [](const LawBody& self) { return std::make_shared<solvers::NodeCloud>(self.body->problem().nodes); },
          "Nodes (a copy).")
      .def_property_readonly(
          "law", [](const LawBody& self) { return self.law; }, "Law.")
      .def_property_readonly(
          "pointwise_share", [](const LawBody& self) { return self.body->pointwise_share(); },
          "Share of the volumetric energy that is taken point by point; 1: no blocks.")
      .def_property_readonly(
          "volume", [](const LawBody& self) { return self.body->volume(); }, "m3, of the points of integration.");
}

void bind_status(py::module_& module) {
  py::class_<EquilibriumStatus>(module, "EquilibriumStatus", "How an equilibrium was found.")
      .def_readonly("iterations", &EquilibriumStatus::iterations, "Of all steps.")
      .def_readonly("evaluations", &EquilibriumStatus::evaluations, "Of the energy.")
      .def_readonly("steps", &EquilibriumStatus::steps, "Parts that the way was gone in.")
      .def_readonly("halvings", &EquilibriumStatus::halvings, "Of steps.")
      .def_readonly("factorisations", &EquilibriumStatus::factorisations, "Of the tangent.")
      .def_readonly("residual", &EquilibriumStatus::residual, "Norm of the unbalanced forces over the acting ones.")
      .def_readonly("least_jacobian", &EquilibriumStatus::least_jacobian, "Least det F of all points.")
      .def_readonly("energy", &EquilibriumStatus::energy, "J, strain energy.")
      .def_readonly("touching", &EquilibriumStatus::touching, "Nodes that touch the tool.")
      .def_readonly("penetration", &EquilibriumStatus::penetration, "Of the tool, in spacings, left over.")
      .def_property_readonly(
          "tool_force", [](const EquilibriumStatus& self) { return array_of(self.tool_force); },
          "(3,), N, of the body on the tool.")
      .def_property_readonly(
          "tool_torque", [](const EquilibriumStatus& self) { return array_of(self.tool_torque); },
          "(3,), N m, of the same about the tool's point.");
}

std::shared_ptr<BodyEquilibrium> equilibrium_of(std::shared_ptr<LawBody> body, const std::string& method,
                                                double tolerance, int maximum_iterations, int halvings,
                                                double least_jacobian, double penetration, bool fall_back) {
  solvers::EquilibriumOptions options;
  options.method = solvers::finite_method_from_string(method);
  options.tolerance = tolerance;
  options.maximum_iterations = maximum_iterations;
  options.halvings = halvings;
  options.least_jacobian = least_jacobian;
  options.penetration = penetration;
  options.fall_back = fall_back;
  auto made =
      with_law_body(*body, [&](const FiniteBody& inner) { return std::make_unique<Equilibrium>(inner, options); });
  return std::make_shared<BodyEquilibrium>(BodyEquilibrium{std::move(body), std::move(made)});
}

EquilibriumStatus solve(BodyEquilibrium& self, const std::optional<topology::ToolPose>& pose, double load_factor,
                        const std::optional<Doubles>& prescribed) {
  solvers::FiniteLoading loading;
  loading.load_factor = load_factor;
  loading.tool = pose;
  if (prescribed)
    loading.prescribed = points_from(*prescribed, "prescribed");
  return with_equilibrium(self, [&](Equilibrium& equilibrium) { return equilibrium.solve(loading); });
}

void bind_equilibrium(py::module_& module) {
  py::class_<BodyEquilibrium, std::shared_ptr<BodyEquilibrium>>(
      module, "Equilibrium",
      "Equilibria of a FiniteBody along a way of loads, given displacements and poses of a tool.")
      .def(py::init(&equilibrium_of), "body"_a, py::kw_only(), "method"_a = "quasi_newton", "tolerance"_a = 1e-3,
           "maximum_iterations"_a = 100, "halvings"_a = 6, "least_jacobian"_a = 0.01, "penetration"_a = 1e-3,
           "fall_back"_a = true,
           "method: 'quasi_newton' or 'newton'. tolerance: of the unbalanced forces over the acting ones. "
           "maximum_iterations: of a step, which is then halved. halvings: of a step, before Newton's method is asked, "
           "if fall_back. least_jacobian: where a search stops short. penetration: of the tool, in spacings.")
      .def(
          "set_contact",
          [](BodyEquilibrium& self, const Tool& tool, const py::array& nodes, const std::string& condition,
             double friction) {
            const std::vector<int> numbers = indices_from(nodes, "nodes", self.body->body->size());
            const solvers::FiniteContactOptions options{.condition = contact_condition_from(condition),
                                                        .friction = friction};
            with_equilibrium(self, [&](Equilibrium& e) { e.set_contact(tool.shape, numbers, options); });
          },
          "tool"_a, "nodes"_a, "condition"_a = "frictionless", "friction"_a = 0.0,
          "The tool that presses, and the surface nodes, (m,), it may touch. condition: 'frictionless', 'frictional' "
          "with Coulomb's coefficient friction, or 'bonded'.")
      .def(
          "take_hold",
          [](BodyEquilibrium& self, const Tool& tool, const topology::ToolPose& pose, const py::array& nodes) {
            const std::vector<int> numbers = indices_from(nodes, "nodes", self.body->body->size());
            with_equilibrium(self, [&](Equilibrium& e) { e.take_hold(tool.shape, pose, numbers); });
          },
          "tool"_a, "pose"_a, "nodes"_a,
          "A tool at that pose holds these surface nodes, (m,), from now on: they move with it as with a rigid body.")
      .def(
          "let_go", [](BodyEquilibrium& self) { with_equilibrium(self, [](Equilibrium& e) { e.let_go(); }); },
          "There is no tool any more.")
      .def(
          "solve", &solve, "pose"_a = py::none(), "load_factor"_a = 1.0, "prescribed"_a = py::none(),
          "Goes from the present state to equilibrium. pose: of the tool. load_factor: of the body's loads. "
          "prescribed: (k, 3), m, of every entry that is held; None: the body's own. Raises NumericalError where there "
          "is none to be found, and what a function of the law raises: the state is then what it was before.")
      .def_property_readonly(
          "coefficients",
          [](BodyEquilibrium& self) {
            return owned_by_threes(with_equilibrium(self, [](Equilibrium& e) { return VectorX(e.coefficients()); }));
          },
          "(n, 3), m, of the state (a copy).")
      .def(
          "set_coefficients",
          [](BodyEquilibrium& self, const Doubles& coefficients, double load_factor) {
            const VectorX u = coefficients_from(coefficients, self.body->body->size());
            with_equilibrium(self, [&](Equilibrium& e) { e.set_coefficients(u, load_factor); });
          },
          "coefficients"_a, "load_factor"_a = 0.0,
          "Begins from these, (n, 3), m, as from a state with that part of the loads.")
      .def_property_readonly(
          "constraint_forces",
          [](BodyEquilibrium& self) {
            return owned(
                with_equilibrium(self, [](Equilibrium& e) { return std::vector<Vector3>(e.constraint_forces()); }));
          },
          "(k, 3), N, on the body, of every entry that is held.")
      .def_property_readonly(
          "contact_forces",
          [](BodyEquilibrium& self) {
            return owned(with_equilibrium(self, [](Equilibrium& e) {
              return e.contact() != nullptr ? e.contact()->forces() : std::vector<Vector3>{};
            }));
          },
          "(m, 3), N, on the body at every node that the tool may touch; empty without a tool.");
}

} // namespace

void bind_finite(py::module_& module) {
  bind_values(module);
  bind_law_body(module);
  bind_status(module);
  bind_equilibrium(module);
}

} // namespace spherecut::bindings
