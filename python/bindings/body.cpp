// Bodies: a boundary value problem, discretised and factored; its fields.
#include "python/bindings/floors.hpp"
#include "python/bindings/held.hpp"
#include "src/output/cut_output.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <utility>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using solvers::Field;
using solvers::Material;

Held held_from(const py::object& region, const std::array<bool, 3>& components, const py::object& displacement) {
  Held held;
  if (py::isinstance<app::FixedRegion>(region))
    held.region = region.cast<std::shared_ptr<app::FixedRegion>>();
  else if (PyCallable_Check(region.ptr()) != 0)
    held.function.emplace(region);
  else
    throw InputError(
        fmt::format("region: {}; allowed: a Region, or a function of x and normal", std::string(py::repr(region))));
  if (components == std::array{false, false, false})
    throw InputError("components: [False, False, False]; allowed: at least one that is held");
  held.components = components;
  const VectorFunction given = vector_function(displacement, "displacement");
  if (displacement.is_none())
    return held;
  if (PyCallable_Check(displacement.ptr()) != 0)
    held.field = given;
  else
    held.value = given(Vector3::Zero());
  return held;
}

// The displacement of the first that holds an axis there; the normal is not known here, so a function's own region is
// where its displacement is asked for.
Vector3 first_displacement(const std::vector<Held>& all, const Vector3& x) {
  Vector3 value = Vector3::Zero();
  std::array<bool, 3> given{};
  for (const Held& held : all) {
    if (held.region && !held.region->holds(x))
      continue;
    const Vector3 here = held.at(x);
    for (std::size_t a = 0; a < 3; ++a)
      if (held.components[a] && !std::exchange(given[a], true))
        value[static_cast<Eigen::Index>(a)] = here[static_cast<Eigen::Index>(a)];
  }
  return value;
}

// Where several hold an axis of a node the first counts.
void hold_nodes(const std::vector<Held>& all, solvers::Problem& problem) {
  const solvers::NodeCloud& nodes = problem.nodes;
  std::vector<int> count(all.size(), 0);
  for (int i = 0; i < nodes.size(); ++i) {
    const auto node = static_cast<std::size_t>(i);
    if (nodes.kinds[node] != solvers::NodeKind::surface && nodes.kinds[node] != solvers::NodeKind::edge)
      continue;
    std::array<bool, 3> given{};
    for (std::size_t k = 0; k < all.size(); ++k) {
      if (!all[k].holds(nodes.positions[node], nodes.normals[node]))
        continue;
      ++count[k];
      std::array<bool, 3> axes{};
      for (std::size_t a = 0; a < 3; ++a)
        axes[a] = all[k].components[a] && !std::exchange(given[a], given[a] || all[k].components[a]);
      if (axes != std::array{false, false, false})
        problem.prescribed.push_back({i, axes, all[k].at(nodes.positions[node])});
    }
  }
  for (std::size_t k = 0; k < all.size(); ++k)
    if (count[k] == 0)
      throw InputError(fmt::format("held[{}]: no surface node lies in its region; allowed: at least one", k));
}

std::shared_ptr<Body> body_from(std::shared_ptr<topology::Domain> domain, const solvers::NodeCloud& nodes,
                                const Material& material, const std::vector<Held>& held, const py::object& body_force,
                                const py::object& traction, const py::object& lip_traction,
                                const std::optional<Doubles>& initial_strain,
                                std::shared_ptr<topology::Incision> incision, const std::string& method,
                                const std::string& sight, const std::string& unheld, double support_radius,
                                double cell_size, bool cut_ahead, const std::optional<Doubles>& touched_from) {
  solvers::Problem problem;
  problem.domain = std::move(domain);
  problem.incision = std::move(incision);
  problem.nodes = nodes;
  problem.material = material;
  problem.loads = loads_from(body_force, traction, lip_traction);
  if (initial_strain)
    problem.loads.initial_strain = matrix_from(*initial_strain, "initial_strain");
  if (touched_from)
    problem.touched_from = vector_from(*touched_from, "touched_from").normalized();
  solvers::DiscretisationOptions options;
  options.method = solvers::method_from_string(method);
  options.sight = solvers::sight_rule_from_string(sight);
  options.unheld = solvers::unheld_pieces_from_string(unheld);
  options.support_radius = support_radius;
  options.cell_size = cell_size;
  options.cut_ahead = cut_ahead;
  return unlocked([&] {
    hold(held, problem);
    auto body = std::make_shared<Body>();
    body->discretisation = solvers::discretise(std::move(problem), options);
    return body;
  });
}

py::array von_mises_of(const PointValues& values) {
  std::vector<double> stress;
  for (const Matrix3& s : values.stress)
    stress.push_back(app::von_mises(s));
  return owned(std::move(stress));
}

PointValues fields_at(const Body& self, const Doubles& points, const Field& field) {
  const std::vector<Vector3> x = one_or_more_points(points, "points");
  return with_body(self, [&](const solvers::Discretisation& body) {
    PointValues values;
    for (const Vector3& point : x) {
      interruption_point();
      values.add(body.at(point, field));
    }
    return values;
  });
}

py::dict report_of(const Body& self) {
  const solvers::AssemblyReport& report = self.discretisation->report();
  return py::dict("nodes"_a = report.nodes, "unknowns"_a = report.unknowns,
                  "matrix_nonzeros"_a = report.matrix_nonzeros, "factor_nonzeros"_a = report.factor_nonzeros,
                  "condition_estimate"_a = report.condition_estimate,
                  "worst_moment_condition"_a = report.worst_moment_condition, "pieces"_a = report.pieces.size(),
                  "supports_seconds"_a = report.supports_seconds, "assembly_seconds"_a = report.assembly_seconds,
                  "factor_seconds"_a = report.factor_seconds);
}

void bind_material(py::module_& module) {
  py::class_<Material>(module, "Material", "Isotropic linear elasticity.")
      .def(py::init([](double young_modulus, double poisson_ratio, double density) {
             const Material material{young_modulus, poisson_ratio, density};
             material.check();
             return material;
           }),
           "young_modulus"_a, "poisson_ratio"_a, "density"_a = 1060.0,
           "young_modulus: E, Pa. poisson_ratio: nu, 0 to below 0.5. density: kg/m3, for weight alone.")
      .def_readonly("young_modulus", &Material::young_modulus, "E, Pa.")
      .def_readonly("poisson_ratio", &Material::poisson_ratio, "nu.")
      .def_readonly("density", &Material::density, "kg/m3.")
      .def_property_readonly("shear_modulus", &Material::shear_modulus, "mu, Pa.")
      .def_property_readonly("lame_lambda", &Material::lame_lambda, "Pa.");
}

void bind_field(py::module_& module) {
  py::class_<PointValues>(module, "PointValues", "What a field is at n points. The arrays are its own memory.")
      .def_property_readonly(
          "displacement",
          [](const py::object& self) { return view(self.cast<const PointValues&>().displacement, self); }, "(n, 3), m.")
      .def_property_readonly(
          "gradient", [](const py::object& self) { return view(self.cast<const PointValues&>().gradient, self); },
          "(n, 3, 3): du_i/dx_j.")
      .def_property_readonly(
          "strain", [](const py::object& self) { return view(self.cast<const PointValues&>().strain, self); },
          "(n, 3, 3).")
      .def_property_readonly(
          "stress", [](const py::object& self) { return view(self.cast<const PointValues&>().stress, self); },
          "(n, 3, 3), Pa.")
      .def("von_mises", &von_mises_of, "(n,), Pa.");
  py::class_<Field>(module, "Field", "A solution of a body. It can be scaled and added to others of the same body.")
      .def_property_readonly(
          "coefficients",
          [](const py::object& self) { return view_by_threes(self.cast<const Field&>().coefficients, self); },
          "(n, 3), m: nodal coefficients, of which displacements are sums; the field's own memory.")
      .def_property_readonly(
          "pressure", [](const py::object& self) { return view(self.cast<const Field&>().pressure, self); },
          "(n,), Pa, of a body that has pressures; else empty.")
      .def_readonly("load_factor", &Field::load_factor, "Multiple of the body's loads that acts.")
      .def(
          "plus",
          [](const Field& self, const Field& other, double factor) {
            Field sum = self;
            sum.add(factor, other);
            return sum;
          },
          "other"_a, "factor"_a = 1.0, "self + factor * other. Raises InputError for a field of another body.");
  py::class_<Held>(module, "Held", "A part of a body's surface whose displacement is given.")
      .def(py::init(&held_from), "region"_a, "components"_a = std::array{true, true, true},
           "displacement"_a = py::none(),
           "region: a Region, or a function of x, (3,), m, and normal, (3,), that tells whether the surface is held "
           "there. components: which axes are held. displacement: (3,), m, or a function of x; None: zero.");
}

void bind_body_class(py::module_& module) {
  py::class_<Body, std::shared_ptr<Body>>(
      module, "Body",
      "A body, discretised and factored once, for any number of solutions. One thread works with it at a time; others "
      "wait.")
      .def(
          py::init(&body_from), "domain"_a, "nodes"_a, "material"_a, "held"_a, py::kw_only(),
          "body_force"_a = py::none(), "traction"_a = py::none(), "lip_traction"_a = py::none(),
          "initial_strain"_a = py::none(), "incision"_a = py::none(), "method"_a = "galerkin", "sight"_a = "enriched",
          "unheld"_a = "refuse", "support_radius"_a = 0.0, "cell_size"_a = 0.75, "cut_ahead"_a = false,
          "touched_from"_a = py::none(),
          "held: list of Held. body_force: N/m3, (3,) or a function of x. traction: Pa on the surface, (3,) or a "
          "function of x and normal. lip_traction: Pa on the faces of the cut, the same; the normal points into the "
          "cut. initial_strain: (3, 3), stress-free strain; pre-tension is negative. method: 'galerkin', "
          "'collocation' or 'published'. sight: 'visibility', 'diffraction', 'enriched' or 'appended'. unheld, of "
          "pieces that nothing holds: 'refuse', 'hold' or 'drop'. support_radius, in spacings; 0: the method's own. "
          "cell_size, in spacings. cut_ahead: the body is compared with cut ones. touched_from: (3,) towards the tool. "
          "Raises InputError for a problem that cannot be used, NumericalError naming the node or the condition.")
      .def(
          "solve",
          [](const Body& self) {
            return with_body(self, [](const solvers::Discretisation& body) { return body.solve(); });
          },
          "Field under loads and given displacements, without a tool.")
      .def("at", &fields_at, "points"_a, "field"_a,
           "PointValues of the field at points, (n, 3), m. Raises InputError for a point that no sphere covers.")
      .def(
          "nodal_displacements",
          [](const Body& self, const Field& field) {
            return owned_by_threes(
                with_body(self, [&](const solvers::Discretisation& body) { return body.nodal_displacements(field); }));
          },
          "field"_a, "(n, 3), m, at the nodes.")
      .def(
          "contact_displacements",
          [](const Body& self, const py::array& nodes, const Field& field) {
            const std::vector<int> numbers = indices_from(nodes, "nodes", self.discretisation->problem().nodes.size());
            return owned_by_threes(with_body(self, [&](const solvers::Discretisation& body) {
              return VectorX(body.contact_displacements(numbers, {field}).col(0));
            }));
          },
          "nodes"_a, "field"_a,
          "(k, 3), m: conjugate to a force on each node: with 'galerkin' the mean over its share.")
      .def(
          "force_response",
          [](const Body& self, const py::array& nodes, const Doubles& forces) {
            const std::vector<int> numbers = indices_from(nodes, "nodes", self.discretisation->problem().nodes.size());
            const std::vector<Vector3> newtons = points_from(forces, "forces");
            return with_body(
                self, [&](const solvers::Discretisation& body) { return body.force_response(numbers, newtons); });
          },
          "nodes"_a, "forces"_a, "Field of forces, (k, 3), N, on nodes, (k,), without the body's own loads.")
      .def(
          "constraint_forces",
          [](const Body& self, const Field& field) {
            return owned(
                with_body(self, [&](const solvers::Discretisation& body) { return body.constraint_forces(field); }));
          },
          "field"_a, "(k, 3), N, on the body, of every entry that is held; see held_nodes.")
      .def_property_readonly(
          "held_nodes",
          [](const Body& self) {
            std::vector<int> nodes;
            for (const solvers::Prescribed& entry : self.discretisation->problem().prescribed)
              nodes.push_back(entry.node);
            return owned(std::move(nodes));
          },
          "(k,): the node of every entry that is held.")
      .def(
          "load_work",
          [](const Body& self, const Field& field) {
            return with_body(self, [&](const solvers::Discretisation& body) { return body.load_work(field); });
          },
          "field"_a, "J: work of the loads on the displacements of the field.")
      .def(
          "residual",
          [](const Body& self, const Field& field, const std::optional<py::array>& nodes,
             const std::optional<Doubles>& forces) {
            std::vector<int> numbers;
            if (nodes)
              numbers = indices_from(*nodes, "nodes", self.discretisation->problem().nodes.size());
            const std::vector<Vector3> newtons = forces ? points_from(*forces, "forces") : std::vector<Vector3>{};
            return with_body(
                self, [&](const solvers::Discretisation& body) { return body.residual(field, numbers, newtons); });
          },
          "field"_a, "nodes"_a = py::none(), "forces"_a = py::none(),
          "Largest unbalanced force over the largest force, under the loads and forces, (k, 3), N, on nodes, (k,).")
      .def_property_readonly(
          "nodes",
          [](const Body& self) { return std::make_shared<solvers::NodeCloud>(self.discretisation->problem().nodes); },
          "Nodes (a copy).")
      .def_property_readonly(
          "material", [](const Body& self) { return self.discretisation->problem().material; }, "Material.")
      .def_property_readonly(
          "method", [](const Body& self) { return std::string(solvers::to_string(self.discretisation->method())); },
          "Name of the method.")
      .def_property_readonly("report", &report_of,
                             "dict: nodes, unknowns, matrix_nonzeros, factor_nonzeros, condition_estimate, "
                             "worst_moment_condition, pieces, and seconds of supports, assembly and factor.");
}

} // namespace

bool Held::holds(const Vector3& x, const Vector3& normal) const {
  if (region)
    return region->holds(x);
  const py::gil_scoped_acquire acquire;
  return (**function)(array_of(x), array_of(normal)).cast<bool>();
}

void hold(const std::vector<Held>& all, solvers::Problem& problem) {
  hold_nodes(all, problem);
  const auto holds = [all](const Vector3& x, const Vector3& normal) {
    return std::any_of(all.begin(), all.end(), [&](const Held& held) { return held.holds(x, normal); });
  };
  if (std::all_of(all.begin(), all.end(), [](const Held& h) { return h.components == std::array{true, true, true}; }))
    problem.prescribed_region = holds;
  else
    problem.prescribed_region = [all](const Vector3& x, const Vector3& normal, int axis) {
      return std::any_of(all.begin(), all.end(), [&](const Held& held) {
        return held.components[static_cast<std::size_t>(axis)] && held.holds(x, normal);
      });
    };
  if (std::any_of(all.begin(), all.end(), [](const Held& held) { return static_cast<bool>(held.field); }))
    problem.prescribed_field = [all](const Vector3& x) { return first_displacement(all, x); };
}

solvers::Loads loads_from(const py::object& body_force, const py::object& traction, const py::object& lip_traction) {
  solvers::Loads loads;
  loads.body_force = vector_function(body_force, "body_force");
  loads.traction = boundary_function(traction, "traction");
  loads.lip_traction = boundary_function(lip_traction, "lip_traction");
  return loads;
}

void PointValues::add(const solvers::PointState& state) {
  displacement.push_back(state.displacement);
  gradient.push_back(state.gradient);
  strain.push_back(state.strain);
  stress.push_back(state.stress);
}

PointValues values_of(const std::vector<solvers::PointState>& states) {
  PointValues values;
  for (const solvers::PointState& state : states)
    values.add(state);
  return values;
}

void bind_body(py::module_& module) {
  bind_material(module);
  bind_field(module);
  bind_body_class(module);
}

} // namespace spherecut::bindings
