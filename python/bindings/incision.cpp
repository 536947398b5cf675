// Cuts: sheets, the incision that they make, the way of a blade.
#include "python/bindings/floors.hpp"
#include "python/bindings/shared.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/front_growth.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using topology::BladeSweep;
using topology::FrontFrame;
using topology::Incision;
using topology::SurfaceMesh;

std::shared_ptr<SurfaceMesh> shared_mesh(SurfaceMesh mesh) {
  return std::make_shared<SurfaceMesh>(std::move(mesh));
}

py::list meshes(const std::vector<SurfaceMesh>& sheets) {
  py::list list;
  for (const SurfaceMesh& sheet : sheets)
    list.append(shared_mesh(sheet));
  return list;
}

void bind_sheets(py::module_& module) {
  module.def(
      "disc_sheet",
      [](const Doubles& centre, const Doubles& normal, double radius, double edge) {
        return shared_mesh(
            topology::make_disc_sheet(vector_from(centre, "centre"), vector_from(normal, "normal"), radius, edge));
      },
      "centre"_a, "normal"_a, "radius"_a, "edge"_a,
      "Disc as the sheet of a cut. centre: (3,), m. normal: (3,), to its + side. radius, edge of triangles: m.");
  module.def(
      "rectangle_sheet",
      [](const Doubles& centre, const Doubles& normal, const Doubles& up, double width, double height, double edge) {
        return shared_mesh(topology::make_rectangle_sheet(vector_from(centre, "centre"), vector_from(normal, "normal"),
                                                          vector_from(up, "up"), width, height, edge));
      },
      "centre"_a, "normal"_a, "up"_a, "width"_a, "height"_a, "edge"_a,
      "Rectangle as the sheet of a cut: height m along up, width m along normal x up.");
  module.def(
      "polygon_sheet",
      [](const Doubles& corners, double edge) {
        return shared_mesh(topology::make_polygon_sheet(points_from(corners, "corners"), edge));
      },
      "corners"_a, "edge"_a,
      "Simple polygon in one plane as the sheet of a cut. corners: (n, 3), m, counter-clockwise from its + side.");
  module.def(
      "read_sheet",
      [](const std::filesystem::path& file, double scale) {
        return unlocked([&] { return shared_mesh(topology::read_sheet(file, scale)); });
      },
      "file"_a, "scale"_a = 1.0, "Sheet from a surface file, open or closed, mended. scale: metres in its unit.");
}

void bind_frames(py::module_& module) {
  py::class_<FrontFrame>(module, "FrontFrame", "A point of the front of a cut with the directions there.")
      .def_property_readonly(
          "point", [](const FrontFrame& self) { return array_of(self.point); }, "(3,), m.")
      .def_property_readonly(
          "ahead", [](const FrontFrame& self) { return array_of(self.ahead); },
          "(3,) unit, in the sheet's tangent plane, out of it: where the front would grow.")
      .def_property_readonly(
          "normal", [](const FrontFrame& self) { return array_of(self.normal); },
          "(3,) unit, to the + side of the sheet.")
      .def_property_readonly(
          "tangent", [](const FrontFrame& self) { return array_of(self.tangent); },
          "(3,) unit, along the front: normal x ahead.")
      .def_readonly("distance", &FrontFrame::distance, "m, from the point that was asked about.")
      .def_readonly("segment", &FrontFrame::segment, "Row of Incision.front.");
}

py::dict closest_to(const Incision& incision, const Doubles& points, double reach) {
  const std::vector<Vector3> x = one_or_more_points(points, "points");
  std::vector<Vector3> point, normal;
  std::vector<double> distance;
  std::vector<int> sheet, triangle;
  unlocked([&] {
    for (const Vector3& place : x) {
      interruption_point();
      const topology::SheetPoint found = incision.closest(place, reach).value_or(topology::SheetPoint{});
      point.push_back(found.point);
      normal.push_back(found.normal);
      distance.push_back(found.distance);
      sheet.push_back(found.sheet);
      triangle.push_back(found.triangle);
    }
  });
  return py::dict("point"_a = owned(std::move(point)), "normal"_a = owned(std::move(normal)),
                  "distance"_a = owned(std::move(distance)), "sheet"_a = owned(std::move(sheet)),
                  "triangle"_a = owned(std::move(triangle)));
}

py::array blocked_between(const Incision& self, const Doubles& from, const Doubles& to) {
  const std::vector<Vector3> a = one_or_more_points(from, "a"), b = one_or_more_points(to, "b");
  if (a.size() != b.size() && a.size() != 1 && b.size() != 1)
    throw InputError(fmt::format("b: {} points for {} of a; allowed: as many, or one of either", b.size(), a.size()));
  const std::size_t count = std::max(a.size(), b.size());
  return bools(unlocked([&] {
    std::vector<char> values;
    for (std::size_t i = 0; i < count; ++i) {
      interruption_point();
      values.push_back(self.blocks(a[a.size() == 1 ? 0 : i], b[b.size() == 1 ? 0 : i]) ? 1 : 0);
    }
    return values;
  }));
}

void bind_incision_class(py::module_& module) {
  py::class_<Incision, std::shared_ptr<Incision>>(
      module, "Incision",
      "All sheets of a cut at one moment, in the body at rest. It does not change; several threads may ask it.")
      .def(py::init(
               [](const std::vector<std::shared_ptr<SurfaceMesh>>& sheets, std::shared_ptr<topology::Domain> domain) {
                 std::vector<SurfaceMesh> copies;
                 copies.reserve(sheets.size());
                 for (const auto& sheet : sheets)
                   copies.push_back(*sheet);
                 return unlocked([&] { return std::make_shared<Incision>(std::move(copies), std::move(domain)); });
               }),
           "sheets"_a, "domain"_a)
      .def_property_readonly(
          "sheets", [](const Incision& self) { return meshes(self.sheets()); }, "List of Surface (copies).")
      .def_property_readonly(
          "front",
          [](const Incision& self) {
            std::vector<std::array<Vector3, 2>> segments;
            for (const topology::FrontSegment& segment : self.front())
              segments.push_back({segment.from, segment.to});
            return owned(std::move(segments));
          },
          "(n, 2, 3), m: pieces of the border of the sheets inside the body.")
      .def_property_readonly(
          "front_sheets",
          [](const Incision& self) {
            std::vector<int> sheets;
            for (const topology::FrontSegment& segment : self.front())
              sheets.push_back(segment.sheet);
            return owned(std::move(sheets));
          },
          "(n,): the sheet of each row of front.")
      .def_property_readonly("area", &Incision::area, "m2, of the sheets inside the body.")
      .def_property_readonly("front_length", &Incision::front_length, "m.")
      .def("blocks", &blocked_between, "a"_a, "b"_a,
           "(n,) of bool: whether a sheet lies between points a and b, (n, 3) or (3,), m: sight lines. Touching "
           "counts.")
      .def("closest", &closest_to, "points"_a, "reach"_a,
           "Nearest points of the sheets within reach m of points, (n, 3), m: dict of point (n, 3), normal (n, 3), "
           "distance (n,), sheet (n,), triangle (n,); distance is inf and sheet -1 where there is none.")
      .def(
          "front_frame",
          [](const Incision& self, const Doubles& point, double reach) {
            return self.front_frame(vector_from(point, "point"), reach);
          },
          "point"_a, "reach"_a, "FrontFrame of the nearest point of the front within reach m of point, (3,), or None.")
      .def(
          "detour",
          [](const Incision& self, const Doubles& x, const Doubles& y,
             double reach) -> std::optional<std::pair<double, py::array>> {
            const auto found =
                self.detour(topology::Eye(vector_from(x, "x")), topology::Eye(vector_from(y, "y")), reach);
            if (!found)
              return std::nullopt;
            return std::pair(found->length, array_of(found->over));
          },
          "x"_a, "y"_a, "reach"_a,
          "Shortest way around the front between points that do not see each other, no longer than reach m: its "
          "length, "
          "m, and the point of the front, (3,), m; or None.");
}

py::dict sweep_result(const topology::SweepResult& result) {
  return py::dict("triangles"_a = result.triangles, "area"_a = result.area, "refused"_a = result.refused);
}

void bind_blade(py::module_& module) {
  py::class_<BladeSweep>(module, "BladeSweep",
                         "A blade drawn through a body, and the sheets that its edge sweeps, in the body at rest.")
      .def(py::init([](const Doubles& edge, std::shared_ptr<topology::Domain> domain, double triangle_edge,
                       double edge_radius) {
             topology::SweepOptions options;
             options.edge = triangle_edge;
             return BladeSweep(topology::Blade{points_from(edge, "edge"), edge_radius}, std::move(domain), options);
           }),
           "edge"_a, "domain"_a, "triangle_edge"_a = 0.002, "edge_radius"_a = 1e-4,
           "edge: (n, 3), m, a polyline in the blade's frame. triangle_edge: m, of the sheets' triangles.")
      .def(
          "move_to",
          [](BladeSweep& self, double time, const Doubles& position, const Doubles& orientation,
             const py::object& to_rest) {
            const topology::BladePose pose = blade_pose_from(time, position, orientation);
            const VectorFunction map = vector_function(to_rest, "to_rest");
            return sweep_result(unlocked([&] { return self.move_to(pose, map); }));
          },
          "time"_a, "position"_a, "orientation"_a = Doubles(owned(std::vector<double>{1, 0, 0, 0})),
          "to_rest"_a = py::none(),
          "Moves the blade's frame to position, (3,), m, turned by orientation: (3, 3), a rotation, or (4,), a unit "
          "quaternion w, x, y, z. The first call only places it. to_rest: function from a point of the deformed body "
          "to "
          "its place at rest, both (3,), m. Returns a dict: triangles added, their area, m2, and refused, why none "
          "were.")
      .def("lift", &BladeSweep::lift, "The next motion only places the blade.")
      .def_property_readonly(
          "sheets", [](const BladeSweep& self) { return meshes(self.sheets()); }, "List of Surface (copies).")
      .def_property_readonly(
          "incision", [](const BladeSweep& self) { return variable(self.incision()); }, "The sheets as an Incision.")
      .def_property_readonly(
          "edge_at_rest", [](const BladeSweep& self) { return owned(std::vector<Vector3>(self.edge_at_rest())); },
          "(n, 3), m: where the edge is in the body at rest; empty before the first pose.");
}

void bind_growth(py::module_& module) {
  module.def(
      "grow_front",
      [](const Incision& incision, const py::function& motion, double edge) {
        const Kept function{motion};
        const auto moved = [&function](const FrontFrame& frame) {
          const py::gil_scoped_acquire acquire;
          return vector_from((*function)(frame).cast<Doubles>(), "motion");
        };
        const topology::FrontGrowth growth = unlocked([&] { return topology::grow_front(incision, moved, edge); });
        return py::dict("sheets"_a = meshes(growth.sheets), "triangles"_a = growth.triangles, "area"_a = growth.area);
      },
      "incision"_a, "motion"_a, "edge"_a,
      "Moves the front by motion(FrontFrame), (3,), m, and fills what it sweeps with triangles of about edge m. "
      "Returns "
      "a dict: sheets, each continued, triangles added, and their area, m2.");
}

} // namespace

void bind_incision(py::module_& module) {
  bind_sheets(module);
  bind_frames(module);
  bind_incision_class(module);
  bind_blade(module);
  bind_growth(module);
}

} // namespace spherecut::bindings
