// Nodes and their sprinkling.
#include "solvers/nodes/nodes.hpp"
#include "python/bindings/floors.hpp"
#include "python/bindings/shared.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using solvers::NodeCloud;
using solvers::NodeKind;
using solvers::SpacingField;
using solvers::Sprinkling;

std::shared_ptr<NodeCloud> cloud_from(const Doubles& positions, const Doubles& spacings, const py::array& kinds,
                                      const std::optional<Doubles>& normals, const std::optional<Doubles>& reaches) {
  auto cloud = std::make_shared<NodeCloud>();
  cloud->positions = points_from(positions, "positions");
  const std::size_t count = cloud->positions.size();
  const auto require = [&](std::size_t length, const char* name) {
    if (length != count)
      throw InputError(fmt::format("{}: {} of them for {} positions; allowed: as many", name, length, count));
  };
  cloud->spacings = numbers_from(spacings, "spacings");
  require(cloud->spacings.size(), "spacings");
  cloud->reaches = reaches ? numbers_from(*reaches, "reaches") : cloud->spacings;
  require(cloud->reaches.size(), "reaches");
  for (std::size_t i = 0; i < count; ++i)
    if (!(cloud->spacings[i] > 0) || !(cloud->reaches[i] > 0) || !(cloud->reaches[i] <= cloud->spacings[i]))
      throw InputError(fmt::format("node {}: spacing {:g} m, reach {:g} m; allowed: above 0, the reach at most the "
                                   "spacing",
                                   i, cloud->spacings[i], cloud->reaches[i]));
  const std::vector<int> numbers = indices_from(kinds, "kinds", 4);
  require(numbers.size(), "kinds");
  for (const int kind : numbers)
    cloud->kinds.push_back(static_cast<NodeKind>(kind));
  cloud->normals = normals ? points_from(*normals, "normals") : std::vector<Vector3>(count, Vector3::Zero());
  require(cloud->normals.size(), "normals");
  return cloud;
}

void bind_cloud(py::module_& module) {
  py::enum_<NodeKind>(module, "NodeKind", py::arithmetic(), "What a node is: the numbers in Nodes.kinds.")
      .value("INTERIOR", NodeKind::interior)
      .value("SURFACE", NodeKind::surface)
      .value("EDGE", NodeKind::edge)
      .value("LIP", NodeKind::lip);
  py::class_<NodeCloud, std::shared_ptr<NodeCloud>>(
      module, "Nodes", "Nodes of a body at rest. They do not change; the arrays are their own memory.")
      .def(py::init(&cloud_from), "positions"_a, "spacings"_a, "kinds"_a, "normals"_a = py::none(),
           "reaches"_a = py::none(),
           "positions: (n, 3), m. spacings, reaches: (n,), m. kinds: (n,) numbers of NodeKind. normals: (n, 3) unit, "
           "outward at surface and edge nodes. All are copied.")
      .def("__len__", &NodeCloud::size)
      .def_property_readonly(
          "positions", [](const py::object& self) { return view(self.cast<const NodeCloud&>().positions, self); },
          "(n, 3), m.")
      .def_property_readonly(
          "spacings", [](const py::object& self) { return view(self.cast<const NodeCloud&>().spacings, self); },
          "(n,), m.")
      .def_property_readonly(
          "reaches", [](const py::object& self) { return view(self.cast<const NodeCloud&>().reaches, self); },
          "(n,), m: radii of the spheres are multiples of it.")
      .def_property_readonly(
          "normals", [](const py::object& self) { return view(self.cast<const NodeCloud&>().normals, self); },
          "(n, 3) unit, outward at surface and edge nodes, out of its face at a lip node; zero inside.")
      .def_property_readonly(
          "kinds",
          [](const py::object& self) {
            const auto& kinds = self.cast<const NodeCloud&>().kinds;
            static_assert(sizeof(NodeKind) == 1);
            py::array array = detail::array_at(reinterpret_cast<const std::uint8_t*>(kinds.data()), kinds.size(), self);
            detail::make_read_only(array);
            return array;
          },
          "(n,) of uint8: numbers of NodeKind.")
      .def(
          "on_surface",
          [](const NodeCloud& self) {
            std::vector<char> values;
            for (const NodeKind kind : self.kinds)
              values.push_back(kind == NodeKind::surface || kind == NodeKind::edge ? 1 : 0);
            return bools(values);
          },
          "(n,) of bool: nodes of the body's own surface, sharp edges included.")
      .def(
          "lip_partners", [](const NodeCloud& self) { return owned(solvers::lip_partners(self)); },
          "(n,): the node across the sheet from a lip node, -1 where there is none.")
      .def("__repr__", [](const NodeCloud& self) { return fmt::format("<spherecut.Nodes: {}>", self.size()); });
}

void bind_spacing(py::module_& module) {
  py::class_<SpacingField>(module, "Spacing",
                           "Spacing of nodes that grows with the distance from fine zones: "
                           "clamp(fine + slope (distance - plateau fine), fine, coarse).")
      .def(
          py::init([](double fine, std::optional<double> coarse, double slope, double radius, double plateau,
                      const std::optional<Doubles>& centres, const std::optional<Doubles>& segments) {
            SpacingField field{fine, coarse.value_or(fine), slope, radius, plateau};
            if (centres)
              field.centres = points_from(*centres, "centres");
            if (segments)
              field.segments = segments_from(*segments, "segments");
            return field;
          }),
          "fine"_a, "coarse"_a = py::none(), "slope"_a = 0.3, "radius"_a = 0.0, "plateau"_a = 1.5,
          "centres"_a = py::none(), "segments"_a = py::none(),
          "fine, coarse: m; coarse None: fine everywhere. slope: m per m. radius: m, about each of centres, (n, 3), m. "
          "segments: (n, 2, 3), m, along which it is fine. With neither it is coarse everywhere.")
      .def_readonly("fine", &SpacingField::fine, "m.")
      .def_readonly("coarse", &SpacingField::coarse, "m.")
      .def(
          "__call__",
          [](const SpacingField& self, const Doubles& points) {
            std::vector<double> values;
            for (const Vector3& x : one_or_more_points(points, "points"))
              values.push_back(self(x));
            return owned(std::move(values));
          },
          "points"_a, "(n,), m, at points, (n, 3), m.");
}

solvers::SprinkleOptions options_from(const SpacingField& spacing, const std::optional<Doubles>& seeds,
                                      std::uint64_t random_seed, std::shared_ptr<topology::Incision> incision,
                                      bool ring_ahead) {
  solvers::SprinkleOptions options;
  options.spacing = spacing;
  options.random_seed = random_seed;
  options.incision = std::move(incision);
  options.ring_ahead = ring_ahead;
  if (seeds)
    for (const Vector3& x : points_from(*seeds, "seeds"))
      options.seeds.push_back({x, NodeKind::surface});
  return options;
}

py::list zones_of(const Sprinkling& sprinkling) {
  py::list zones;
  for (const solvers::SprinkleZone& zone : sprinkling.report.zones)
    zones.append(py::dict("spacing_from"_a = zone.spacing_from, "spacing_to"_a = zone.spacing_to,
                          "nodes"_a = zone.nodes, "nearest_min"_a = zone.nearest_min,
                          "nearest_median"_a = zone.nearest_median, "expected"_a = zone.expected,
                          "density"_a = zone.density));
  return zones;
}

} // namespace

void bind_nodes(py::module_& module) {
  bind_cloud(module);
  bind_spacing(module);
  py::class_<Sprinkling>(module, "Sprinkling", "Nodes as they were sprinkled, and what was checked about them.")
      .def_property_readonly(
          "nodes", [](const Sprinkling& self) { return std::make_shared<NodeCloud>(self.nodes); }, "Nodes (a copy).")
      .def_property_readonly("zones", &zones_of,
                             "List of dicts, one for each band of spacing: spacing_from, spacing_to, m; nodes; "
                             "nearest_min, nearest_median, in spacings; expected number; density, about 1.")
      .def_property_readonly(
          "kept_from", [](const Sprinkling& self) { return owned(std::vector<int>(self.kept_from)); },
          "(n,): number of each node in the cloud before, -1 for a new one; empty but after resprinkle().");
  module.def(
      "sprinkle",
      [](const topology::Domain& domain, const SpacingField& spacing, const std::optional<Doubles>& seeds,
         std::uint64_t random_seed, std::shared_ptr<topology::Incision> incision, bool ring_ahead) {
        const auto options = options_from(spacing, seeds, random_seed, std::move(incision), ring_ahead);
        return unlocked([&] { return solvers::sprinkle(domain, options); });
      },
      "domain"_a, "spacing"_a, "seeds"_a = py::none(), "random_seed"_a = 1, "incision"_a = py::none(),
      "ring_ahead"_a = false,
      "Fills a domain with nodes. seeds: (n, 3), m, surface nodes that stand where they are put. The same random_seed "
      "gives the same bits. incision: nodes stand in pairs on the faces of the cut. ring_ahead: nodes ahead of its "
      "front too, which method 'collocation' wants. Raises NumericalError where a zone stays under-filled.");
  module.def(
      "resprinkle",
      [](const topology::Domain& domain, const SpacingField& spacing, const NodeCloud& previous,
         const std::optional<Doubles>& seeds, std::uint64_t random_seed, std::shared_ptr<topology::Incision> incision,
         bool ring_ahead) {
        const auto options = options_from(spacing, seeds, random_seed, std::move(incision), ring_ahead);
        return unlocked([&] { return solvers::resprinkle(domain, options, previous); });
      },
      "domain"_a, "spacing"_a, "previous"_a, "seeds"_a = py::none(), "random_seed"_a = 1, "incision"_a = py::none(),
      "ring_ahead"_a = false, "The same after the fine zone has moved: every node of previous that still fits stays.");
  module.def(
      "expected_count",
      [](const topology::Domain& domain, const SpacingField& spacing, const topology::Incision* incision) {
        return unlocked([&] { return solvers::expected_count(domain, spacing, 40, incision); });
      },
      "domain"_a, "spacing"_a, "incision"_a = py::none(), "Number of nodes to expect of sprinkle(), within 10 %.");
  module.def(
      "spacing_for_count",
      [](const topology::Domain& domain, const SpacingField& spacing, int count) {
        return unlocked([&] { return solvers::spacing_for_count(domain, spacing, count); });
      },
      "domain"_a, "spacing"_a, "count"_a, "spacing with fine and coarse scaled so that there are about count nodes.");
  module.def(
      "front_segments",
      [](const topology::Incision& incision, double length) {
        return owned(solvers::front_segments(incision, length));
      },
      "incision"_a, "length"_a,
      "(n, 2, 3), m: the front in straight pieces of at most length m, for Spacing(segments=...).");
}

} // namespace spherecut::bindings
