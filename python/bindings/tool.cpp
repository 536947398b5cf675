// Tools, their poses, and where they touch an organ at rest.
#include "python/bindings/floors.hpp"
#include "python/bindings/shared.hpp"
#include "topology/base/errors.hpp"
#include "topology/tool/contact.hpp"

#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using topology::ContactQuery;
using topology::SurfaceContact;
using topology::ToolPose;

Tool checked(const topology::ToolShape& shape) {
  topology::check(shape);
  return {shape};
}

ToolPose pose_from(const Doubles& point, const Doubles& axis) {
  return topology::pose_at(topology::SphereTip{}, vector_from(point, "point"), vector_from(axis, "axis"));
}

const Doubles& upwards() {
  static const auto* z = new Doubles(array_of(Vector3(Vector3::UnitZ()))); // as long as the interpreter, never let go
  return *z;
}

void bind_queries(py::module_& module) {
  py::class_<SurfaceContact>(module, "SurfaceContact",
                             "Where a tool is deepest in an organ's surface at rest, or nearest to it.")
      .def_property_readonly(
          "point", [](const SurfaceContact& self) { return array_of(self.point); }, "(3,), m, on the surface.")
      .def_property_readonly(
          "normal", [](const SurfaceContact& self) { return array_of(self.normal); }, "(3,) unit, outward there.")
      .def_readonly("depth", &SurfaceContact::depth, "m; above 0: the tool is in the organ, below: clearance.")
      .def_readonly("triangle", &SurfaceContact::triangle, "Number of the triangle that holds the point.")
      .def_property_readonly(
          "tool_point", [](const SurfaceContact& self) { return array_of(self.tool_point); },
          "(3,), m: the point of the tool's skeleton that is deepest.");
  py::class_<ContactQuery>(module, "ContactQuery",
                           "Finds where tools touch one closed surface. Several threads may ask it.")
      .def(py::init([](const topology::SurfaceMesh& surface) {
             return unlocked([&] { return std::make_unique<ContactQuery>(surface); });
           }),
           "surface"_a)
      .def(
          "first_touch",
          [](const ContactQuery& self, const Tool& tool, const ToolPose& pose) {
            return unlocked([&] { return self.first_touch(tool.shape, pose); });
          },
          "tool"_a, "pose"_a, "Searches the whole surface.")
      .def(
          "walk",
          [](const ContactQuery& self, const Tool& tool, const ToolPose& pose, const SurfaceContact& last) {
            return unlocked([&] { return self.walk(tool.shape, pose, last); });
          },
          "tool"_a, "pose"_a, "last"_a, "The same contact, found from the last one on; the nearer, the faster.");
}

} // namespace

void bind_tool(py::module_& module) {
  py::class_<ToolPose>(module, "ToolPose",
                       "Where a tool is: its reference point and the direction from there into the tool.")
      .def(py::init(&pose_from), "point"_a, "axis"_a = upwards(),
           "point: (3,), m. axis: (3,), of any length, away from the tissue.")
      .def_property_readonly(
          "point", [](const ToolPose& self) { return array_of(self.point); }, "(3,), m.")
      .def_property_readonly(
          "axis", [](const ToolPose& self) { return array_of(self.axis); }, "(3,), unit.");
  py::class_<Tool>(module, "Tool", "A rigid tool.")
      .def_static(
          "sphere_tip", [](double radius) { return checked(topology::SphereTip{radius}); }, "radius"_a,
          "A ball, radius in m; its reference point is the lowest along the axis.")
      .def_static(
          "flat_punch",
          [](double radius, double length) {
            return checked(topology::FlatPunch{radius, length});
          },
          "radius"_a, "length"_a = 0.05, "A flat cylinder, m; its reference point is the centre of the flat end.")
      .def_static(
          "laparoscope",
          [](double tip_radius, double shaft_radius, double shaft_length, const Doubles& port) {
            return checked(topology::Laparoscope{tip_radius, shaft_radius, shaft_length, vector_from(port, "port")});
          },
          "tip_radius"_a, "shaft_radius"_a, "shaft_length"_a, "port"_a,
          "A spherical tip on a shaft that pivots on a port, (3,), m.")
      .def(
          "pose_at",
          [](const Tool& self, const Doubles& point, const Doubles& axis) {
            return topology::pose_at(self.shape, vector_from(point, "point"), vector_from(axis, "axis"));
          },
          "point"_a, "axis"_a = upwards(),
          "The pose with the reference point at point, (3,), m; a laparoscope takes its axis from its port.")
      .def(
          "distance",
          [](const Tool& self, const ToolPose& pose, const Doubles& points) {
            std::vector<double> values;
            for (const Vector3& x : one_or_more_points(points, "points"))
              values.push_back(topology::tool_distance(self.shape, pose, x));
            return owned(std::move(values));
          },
          "pose"_a, "points"_a, "(n,), m: signed distance of points, (n, 3), m, from the tool, negative inside.")
      .def(
          "mesh",
          [](const Tool& self, const ToolPose& pose, double edge) {
            return std::make_shared<topology::SurfaceMesh>(topology::tool_mesh(self.shape, pose, edge));
          },
          "pose"_a, "edge"_a, "Closed surface of the tool with edges of about edge m.");
  bind_queries(module);
}

} // namespace spherecut::bindings
