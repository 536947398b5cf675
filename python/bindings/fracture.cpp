// Stress intensities along the front of a cut, and where it tears on.
#include "python/bindings/floors.hpp"
#include "python/bindings/shared.hpp"
#include "solvers/fracture/tear_seed.hpp"
#include "solvers/fracture/tearing.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using solvers::Field;
using solvers::FrontState;
using solvers::Material;
using topology::FrontFrame;

const topology::Incision& incision_of(const solvers::Discretisation& body) {
  if (body.problem().incision == nullptr)
    throw InputError("body: it has no cut; allowed: one with an incision");
  return *body.problem().incision;
}

solvers::TearDirection direction_from(const std::string& name) {
  if (name == "weakest")
    return solvers::TearDirection::weakest;
  if (name == "hoop_stress")
    return solvers::TearDirection::hoop_stress;
  throw InputError(fmt::format("direction: '{}'; allowed: weakest, hoop_stress", name));
}

void bind_intensities(py::module_& module) {
  module.def(
      "front_samples",
      [](const topology::Incision& incision, double spacing, double margin) {
        return solvers::front_samples(incision, spacing, margin);
      },
      "incision"_a, "spacing"_a, "margin"_a = 0.0,
      "List of FrontFrame about spacing m apart along the front, no nearer than margin m to the body's surface.");
  module.def(
      "interaction_integral",
      [](const Body& body, const Field& field, const FrontFrame& front) {
        return array_of(with_body(body, [&](const solvers::Discretisation& cut) {
          static_cast<void>(incision_of(cut));
          return Vector3(solvers::interaction_integral(cut, field, front));
        }));
      },
      "body"_a, "field"_a, "front"_a,
      "(3,): K_I, K_II, K_III, Pa sqrt(m), at a place of the front by the interaction integral. Raises InputError "
      "where "
      "its tube leaves the body.");
  module.def(
      "displacement_correlation",
      [](const Body& body, const Field& field, const FrontFrame& front) {
        return array_of(with_body(body, [&](const solvers::Discretisation& cut) {
          static_cast<void>(incision_of(cut));
          return Vector3(solvers::displacement_correlation(cut, field, front));
        }));
      },
      "body"_a, "field"_a, "front"_a,
      "(3,): K_I, K_II, K_III, Pa sqrt(m), from the jump of the displacement behind the front.");
  module.def(
      "energy_release_rate",
      [](const Material& material, const Doubles& k) {
        return solvers::energy_release_rate(material, vector_from(k, "k"));
      },
      "material"_a, "k"_a, "G, J/m2, of intensities, (3,), Pa sqrt(m).");
  module.def(
      "kink_angle", [](const Doubles& k) { return solvers::kink_angle(vector_from(k, "k")); }, "k"_a,
      "Angle, rad, in which a front with intensities, (3,), Pa sqrt(m), runs on: largest hoop stress.");
}

void bind_tearing(py::module_& module) {
  py::class_<FrontState>(module, "FrontState", "A place of the front: what drives a tear there, and what resists it.")
      .def_readonly("frame", &FrontState::frame, "FrontFrame.")
      .def_property_readonly(
          "intensities", [](const FrontState& self) { return array_of(Vector3(self.intensities)); },
          "(3,): K_I, K_II, K_III, Pa sqrt(m).")
      .def_readonly("release", &FrontState::release, "G, J/m2.")
      .def_readonly("toughness", &FrontState::toughness, "G_c there, J/m2.")
      .def_readonly("angle", &FrontState::angle, "rad; 0 ahead, positive to the + side of the sheet.")
      .def_readonly("by_integral", &FrontState::by_integral, "False: by the jump behind the front.");
  module.def(
      "front_states",
      [](const Body& body, const Field& field, const py::object& toughness, double spacing) {
        const NumberFunction resistance = number_function(toughness, "toughness");
        return with_body(body, [&](const solvers::Discretisation& cut) {
          static_cast<void>(incision_of(cut));
          return solvers::front_states(cut, field, resistance, spacing);
        });
      },
      "body"_a, "field"_a, "toughness"_a, "spacing"_a,
      "List of FrontState about spacing m apart along the whole front. toughness: G_c, J/m2, a number or a function of "
      "a point of the body at rest, (3,), m.");
  module.def(
      "averaged",
      [](const Material& material, const std::vector<FrontState>& states, double length) {
        return solvers::averaged(material, states, length);
      },
      "material"_a, "states"_a, "length"_a,
      "The states with intensities averaged along the front over about length m.");
  module.def(
      "directed",
      [](const std::vector<FrontState>& states, const py::object& toughness, double probe,
         const std::string& direction) {
        const NumberFunction resistance = number_function(toughness, "toughness");
        const solvers::TearDirection rule = direction_from(direction);
        return unlocked([&] { return solvers::directed(states, rule, resistance, probe); });
      },
      "states"_a, "toughness"_a, "probe"_a, "direction"_a = "weakest",
      "The states turned to where the tissue gives way: 'weakest' looks at the toughness probe m ahead, 'hoop_stress' "
      "does not. toughness: as front_states().");
  module.def(
      "tear_motion",
      [](const std::vector<FrontState>& states, double longest, double smoothing) -> py::object {
        if (states.empty())
          throw InputError("states: none; allowed: at least one");
        auto motion = solvers::tear_motion(states, longest, smoothing);
        return py::cpp_function([motion](const FrontFrame& frame) { return array_of(motion(frame)); }, "frame"_a);
      },
      "states"_a, "longest"_a, "smoothing"_a,
      "Function of a FrontFrame: how the front moves there, (3,), m, for grow_front(). It moves where G >= G_c, by up "
      "to "
      "longest m; directions and lengths are averaged over smoothing m.");
  module.def("seed_radius", &solvers::seed_radius, "material"_a, "toughness"_a, "strength"_a,
             "m: radius of the penny crack that a strength, Pa, and a toughness, J/m2, ask for together.");
  module.def(
      "averaged_stress",
      [](const Body& body, const Field& field, const Doubles& point, double radius) {
        const Vector3 x = vector_from(point, "point");
        const auto found = with_body(
            body, [&](const solvers::Discretisation& b) { return solvers::averaged_stress(b, field, x, radius); });
        return std::pair(found.stress, array_of(found.direction));
      },
      "body"_a, "field"_a, "point"_a, "radius"_a,
      "Largest principal stress, Pa, of the mean over a ball of radius m about point, (3,), m, and its direction, "
      "(3,).");
}

} // namespace

void bind_fracture(py::module_& module) {
  bind_intensities(module);
  bind_tearing(module);
}

} // namespace spherecut::bindings
