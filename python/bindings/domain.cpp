// Domains: the body at rest as an implicit solid; and parts of space by which surface is chosen.
#include "python/bindings/calls.hpp"
#include "python/bindings/floors.hpp"
#include "python/bindings/shared.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using topology::Domain;

template <class T, class Value>
py::array each_point(const Doubles& points, const Value& value) {
  const std::vector<Vector3> x = one_or_more_points(points, "points");
  return owned(unlocked([&] {
    std::vector<T> values;
    values.reserve(x.size());
    for (const Vector3& point : x) {
      interruption_point();
      values.push_back(value(point));
    }
    return values;
  }));
}

void bind_region(py::module_& module) {
  py::class_<app::FixedRegion, std::shared_ptr<app::FixedRegion>>(
      module, "Region", "A part of space: what of a body's surface is held, what nodes are meant.")
      .def_static(
          "box",
          [](const Doubles& lower, const Doubles& upper) {
            return app::FixedRegion{"box", app::BoxRegion{vector_from(lower, "lower"), vector_from(upper, "upper")}};
          },
          "lower"_a, "upper"_a, "Between two corners, (3,), m.")
      .def_static(
          "sphere",
          [](const Doubles& centre, double radius) {
            if (!(radius > 0))
              throw InputError(fmt::format("radius: {:g} m; allowed: above 0", radius));
            return app::FixedRegion{"sphere", app::SphereRegion{vector_from(centre, "centre"), radius}};
          },
          "centre"_a, "radius"_a, "Within radius, m, of the centre, (3,), m.")
      .def_static(
          "half_space",
          [](const Doubles& point, const Doubles& normal) {
            const Vector3 n = vector_from(normal, "normal"), x = vector_from(point, "point");
            if (!(n.norm() > 0))
              throw InputError("normal: [0, 0, 0]; allowed: any other");
            return app::FixedRegion{"half_space", Plane{n.normalized(), n.normalized().dot(x)}};
          },
          "point"_a, "normal"_a, "Behind the plane through point, (3,), m; normal, (3,), points out of the region.")
      .def(
          "holds",
          [](const app::FixedRegion& self, const Doubles& points) {
            std::vector<char> values;
            for (const Vector3& x : one_or_more_points(points, "points"))
              values.push_back(self.holds(x) ? 1 : 0);
            return bools(values);
          },
          "points"_a, "(n,) of bool: which of the points, (n, 3), m, lie in it; to 1e-9 m, bounds included.");
}

} // namespace

void bind_domain(py::module_& module) {
  py::class_<Domain, std::shared_ptr<Domain>>(
      module, "Domain", "A closed solid at rest: what mechanics needs to know of geometry. Several threads may ask it.")
      .def_static(
          "box",
          [](const Doubles& lower, const Doubles& upper, double edge) {
            const Vector3 low = vector_from(lower, "lower"), high = vector_from(upper, "upper");
            return unlocked([&] { return variable(topology::make_box_domain(low, high, edge)); });
          },
          "lower"_a, "upper"_a, "edge"_a,
          "Box between two corners, (3,), m, with exact planes; edge: of the triangles of its surface, m.")
      .def_static(
          "turned_box",
          [](const Doubles& centre, const Doubles& axes, const Doubles& half_size, double edge) {
            const Vector3 middle = vector_from(centre, "centre"), half = vector_from(half_size, "half_size");
            const Matrix3 frame = matrix_from(axes, "axes");
            return unlocked([&] { return variable(topology::make_turned_box_domain(middle, frame, half, edge)); });
          },
          "centre"_a, "axes"_a, "half_size"_a, "edge"_a,
          "Box of edges 2 half_size, (3,), m, about centre, (3,), m, along the columns of axes, (3, 3), a rotation.")
      .def_static(
          "hemisphere",
          [](double radius, double edge) {
            return unlocked([&] { return variable(topology::make_hemisphere_domain(radius, edge)); });
          },
          "radius"_a, "edge"_a, "Half ball on z = 0 with its pole at +z; m.")
      .def_static(
          "cylinder",
          [](double radius, double height, double edge) {
            return unlocked([&] { return variable(topology::make_cylinder_domain(radius, height, edge)); });
          },
          "radius"_a, "height"_a, "edge"_a, "Upright cylinder on z = 0; m.")
      .def_static(
          "organ",
          [](const topology::SurfaceMesh& surface, double voxel_size) {
            return unlocked([&] { return variable(topology::make_organ_domain(surface, voxel_size)); });
          },
          "surface"_a, "voxel_size"_a = 0.0,
          "Solid within a checked closed surface. voxel_size: m, of the level set that gives distances away from the "
          "surface; 0: 1/128 of the largest extent.")
      .def(
          "signed_distance",
          [](const Domain& self, const Doubles& points) {
            return each_point<double>(points, [&](const Vector3& x) { return self.signed_distance(x); });
          },
          "points"_a, "(n,), m, negative inside, at points, (n, 3), m.")
      .def(
          "normal",
          [](const Domain& self, const Doubles& points) {
            return each_point<Vector3>(points, [&](const Vector3& x) { return self.normal(x); });
          },
          "points"_a, "(n, 3): unit gradient of signed_distance at points, (n, 3), m.")
      .def(
          "closest_surface_point",
          [](const Domain& self, const Doubles& points) {
            return each_point<Vector3>(points, [&](const Vector3& x) { return self.closest_surface_point(x); });
          },
          "points"_a, "(n, 3), m: the nearest points of the surface to points, (n, 3), m.")
      .def_property_readonly(
          "surface", [](const Domain& self) { return std::make_shared<topology::SurfaceMesh>(self.surface()); },
          "The surface as triangles (a copy).")
      .def_property_readonly(
          "bounds",
          [](const Domain& self) {
            return owned(std::vector<Vector3>{self.bounds().lower, self.bounds().upper});
          },
          "(2, 3), m: least and greatest coordinates.");
  bind_region(module);
}

} // namespace spherecut::bindings
