// Contact of a tool with a body, and of the lips of its cut.
#include "python/bindings/floors.hpp"
#include "python/bindings/shared.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using solvers::ContactPatch;
using solvers::ContactState;
using solvers::CutContactState;
using solvers::LipPatch;
using solvers::LipState;

/// A patch with the body that it was condensed from.
struct BodyPatch {
  std::shared_ptr<Body> body;
  ContactPatch patch;
};
struct BodyLips {
  std::shared_ptr<Body> body;
  LipPatch lips;
};

solvers::ContactOptions options_of(const std::string& condition, double friction) {
  solvers::ContactOptions options;
  options.condition = contact_condition_from(condition);
  options.friction = friction;
  return options;
}

// Python's numbers of candidates in a patch are checked before they become a state.
void bind_patch(py::module_& module) {
  py::class_<BodyPatch, std::shared_ptr<BodyPatch>>(
      module, "ContactPatch", "A body seen from nodes that a tool may touch: displacement = base + compliance * force.")
      .def_property_readonly(
          "nodes", [](const py::object& self) { return view(self.cast<const BodyPatch&>().patch.nodes, self); },
          "(m,) numbers of nodes.")
      .def_property_readonly(
          "rest", [](const py::object& self) { return view(self.cast<const BodyPatch&>().patch.rest, self); },
          "(m, 3), m, at rest.")
      .def_property_readonly(
          "normals", [](const py::object& self) { return view(self.cast<const BodyPatch&>().patch.normals, self); },
          "(m, 3) unit, outward.")
      .def_property_readonly(
          "compliance",
          [](const py::object& self) { return view(self.cast<const BodyPatch&>().patch.compliance, self); },
          "(3m, 3m), m/N; the patch's own memory.")
      .def_property_readonly(
          "base_displacement",
          [](const py::object& self) {
            return view_by_threes(self.cast<const BodyPatch&>().patch.base_displacement, self);
          },
          "(m, 3), m, without a tool.");
  module.def(
      "condense",
      [](std::shared_ptr<Body> body, const py::array& nodes) {
        const std::vector<int> numbers = indices_from(nodes, "nodes", body->discretisation->problem().nodes.size());
        ContactPatch patch = with_body(
            *body, [&](const solvers::Discretisation& factored) { return solvers::condense(factored, numbers); });
        return std::make_shared<BodyPatch>(BodyPatch{std::move(body), std::move(patch)});
      },
      "body"_a, "nodes"_a, "ContactPatch of surface nodes, (m,), none of them held.");
}

void bind_states(py::module_& module) {
  py::class_<ContactState>(module, "ContactState", "Outcome of pressing a tool into a patch.")
      .def_property_readonly(
          "force", [](const ContactState& self) { return array_of(self.tool_force); },
          "(3,), N, of the body on the tool.")
      .def_property_readonly(
          "torque", [](const ContactState& self) { return array_of(self.tool_torque); },
          "(3,), N m, of the same forces about the tool's point, each where its node is now; of prescribe() about the "
          "origin.")
      .def(
          "torque_about",
          [](const ContactState& self, const Doubles& point) {
            return array_of(solvers::torque_about(self, vector_from(point, "point")));
          },
          "point"_a, "(3,), N m, about another point, (3,), m.")
      .def_property_readonly(
          "nodal_forces",
          [](const py::object& self) { return view(self.cast<const ContactState&>().nodal_forces, self); },
          "(m, 3), N, on the body; the state's own memory.")
      .def_property_readonly(
          "active", [](const ContactState& self) { return bools(self.active); }, "(m,) of bool: nodes in contact.")
      .def_property_readonly(
          "displacement",
          [](const py::object& self) { return view_by_threes(self.cast<const ContactState&>().displacement, self); },
          "(m, 3), m, of the patch's nodes.")
      .def_property_readonly(
          "centre", [](const ContactState& self) { return array_of(self.centre); },
          "(3,), m: mean place of the contact at rest, weighted by normal force.")
      .def_readonly("contact_radius", &ContactState::contact_radius, "m.")
      .def_readonly("largest_penetration", &ContactState::largest_penetration, "m, left over.")
      .def_readonly("active_nodes", &ContactState::active_nodes, "Nodes in contact.")
      .def_readonly("iterations", &ContactState::iterations, "Linearisations of the tool's surface.")
      .def_readonly("converged", &ContactState::converged, "Whether the contact was found.")
      .def_readonly("friction_work", &ContactState::friction_work, "J, on the way from the state before.");
  py::class_<LipState>(module, "LipState", "Which pairs of lips are closed, and their forces.")
      .def_property_readonly(
          "forces", [](const py::object& self) { return view(self.cast<const LipState&>().forces, self); },
          "(entries,), N.")
      .def_property_readonly(
          "openings", [](const py::object& self) { return view(self.cast<const LipState&>().openings, self); },
          "(entries,), m; the normal one of a pair comes first.")
      .def_property_readonly(
          "closed", [](const LipState& self) { return bools(self.closed); }, "(pairs,) of bool.")
      .def_readonly("converged", &LipState::converged, "Whether the contact was found.");
  py::class_<CutContactState>(module, "CutContactState", "Tool and lips in contact together.")
      .def_readonly("tool", &CutContactState::tool, "ContactState.")
      .def_readonly("lips", &CutContactState::lips, "LipState.");
}

void bind_press(py::module_& module) {
  module.def(
      "press",
      [](const BodyPatch& patch, const Tool& tool, const topology::ToolPose& pose, const std::string& condition,
         double friction, const ContactState* previous) {
        const solvers::ContactOptions options = options_of(condition, friction);
        return unlocked([&] { return solvers::press(patch.patch, tool.shape, pose, options, previous); });
      },
      "patch"_a, "tool"_a, "pose"_a, "condition"_a = "frictionless", "friction"_a = 0.0, "previous"_a = py::none(),
      "Presses a tool: no penetration, no tension. condition: 'frictionless', 'frictional' with Coulomb's coefficient "
      "friction, or 'bonded'. previous: state to go on from, of the same patch.");
  module.def(
      "prescribe",
      [](const BodyPatch& patch, const Doubles& displacements) {
        const std::vector<Vector3> given = points_from(displacements, "displacements");
        return unlocked([&] { return solvers::prescribe(patch.patch, given); });
      },
      "patch"_a, "displacements"_a, "ContactState with given displacements, (m, 3), m, of all nodes of the patch.");
  module.def(
      "deform",
      [](const BodyPatch& patch, const ContactState& state) {
        return with_body(*patch.body, [&](const solvers::Discretisation& body) {
          return solvers::deform(body, patch.patch, state);
        });
      },
      "patch"_a, "state"_a, "Field of the body in a contact.");
}

// A patch and lips that were condensed together have one body.
void require_same(const BodyPatch& patch, const BodyLips& lips) {
  if (patch.body != lips.body)
    throw InputError("lips: of another body than the patch; allowed: of the same");
}

void bind_lips(py::module_& module) {
  py::class_<BodyLips, std::shared_ptr<BodyLips>>(module, "LipPatch",
                                                  "A cut body seen from the pairs of nodes on the faces of its cut.")
      .def_property_readonly(
          "pairs",
          [](const BodyLips& self) {
            std::vector<std::array<int, 2>> pairs;
            for (const solvers::LipPair& pair : self.lips.pairs)
              pairs.push_back({pair.plus, pair.minus});
            return owned(std::move(pairs));
          },
          "(p, 2) numbers of nodes, on the + and on the - side of the sheet.")
      .def_property_readonly(
          "normals",
          [](const BodyLips& self) {
            std::vector<Vector3> normals;
            for (const solvers::LipPair& pair : self.lips.pairs)
              normals.push_back(pair.normal);
            return owned(std::move(normals));
          },
          "(p, 3) unit, from the - side to the + side.")
      .def_property_readonly(
          "compliance", [](const py::object& self) { return view(self.cast<const BodyLips&>().lips.compliance, self); },
          "(entries, entries), m/N: opening per pair force.")
      .def_property_readonly(
          "base_opening",
          [](const py::object& self) { return view(self.cast<const BodyLips&>().lips.base_opening, self); },
          "(entries,), m, without tool and pair forces.");
  module.def(
      "condense_lips",
      [](std::shared_ptr<Body> body, const std::string& condition, const BodyPatch* patch) {
        const solvers::LipCondition lips = solvers::lip_condition_from_string(condition);
        LipPatch condensed = with_body(*body, [&](const solvers::Discretisation& factored) {
          return solvers::condense_lips(factored, solvers::lip_pairs(factored.problem().nodes), lips,
                                        patch == nullptr ? nullptr : &patch->patch);
        });
        return std::make_shared<BodyLips>(BodyLips{std::move(body), std::move(condensed)});
      },
      "body"_a, "condition"_a = "frictionless", "patch"_a = py::none(),
      "LipPatch of all pairs of a cut body. condition: 'frictionless' or 'sticking'. patch: of the tool, if there is "
      "one.");
  module.def(
      "close_lips",
      [](const BodyLips& lips, double tolerance) {
        return unlocked([&] { return solvers::close_lips(lips.lips, lips.lips.base_opening, tolerance); });
      },
      "lips"_a, "tolerance"_a = 1e-9,
      "LipState under the body's own loads: no pair goes through itself by more than tolerance m, and none pulls.");
  module.def(
      "press_with_lips",
      [](const BodyPatch& patch, const BodyLips& lips, const Tool& tool, const topology::ToolPose& pose,
         const std::string& condition, double friction, const CutContactState* previous) {
        require_same(patch, lips);
        const solvers::ContactOptions options = options_of(condition, friction);
        return unlocked([&] { return solvers::press(patch.patch, lips.lips, tool.shape, pose, options, previous); });
      },
      "patch"_a, "lips"_a, "tool"_a, "pose"_a, "condition"_a = "frictionless", "friction"_a = 0.0,
      "previous"_a = py::none(),
      "press() with the contact of the lips found at the same time. lips: condensed with "
      "patch.");
  module.def(
      "deform_with_lips",
      [](const BodyPatch& patch, const BodyLips& lips, const CutContactState& state) {
        require_same(patch, lips);
        return with_body(*patch.body, [&](const solvers::Discretisation& body) {
          return solvers::deform(body, patch.patch, lips.lips, state);
        });
      },
      "patch"_a, "lips"_a, "state"_a, "Field of the body in a contact of tool and lips.");
  module.def(
      "deform_closed",
      [](const BodyLips& lips, const LipState& state) {
        return with_body(*lips.body, [&](const solvers::Discretisation& body) {
          return solvers::deform(body, body.solve(), lips.lips, state);
        });
      },
      "lips"_a, "state"_a, "Field of the body under its own loads with its lips in contact.");
}

} // namespace

solvers::ContactCondition contact_condition_from(const std::string& name) {
  if (name == "frictionless")
    return solvers::ContactCondition::frictionless;
  if (name == "frictional")
    return solvers::ContactCondition::frictional;
  if (name == "bonded")
    return solvers::ContactCondition::bonded;
  throw InputError(fmt::format("condition: '{}'; allowed: frictionless, frictional, bonded", name));
}

void bind_contact(py::module_& module) {
  bind_patch(module);
  bind_states(module);
  bind_press(module);
  bind_lips(module);
}

} // namespace spherecut::bindings
