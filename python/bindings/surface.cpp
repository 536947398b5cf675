// Surfaces: from arrays and files, checked and mended; organs made here; label volumes.
#include "python/bindings/calls.hpp"
#include "python/bindings/floors.hpp"
#include "topology/base/errors.hpp"
#include "topology/files/label_volume.hpp"
#include "topology/organ/organs.hpp"
#include "topology/organ/surface_check.hpp"

#include <Eigen/LU>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using topology::CheckedSurface;
using topology::SurfaceMesh;

topology::SurfaceChoices choices_from(const std::string& pieces, const std::string& cavities) {
  topology::SurfaceChoices choices;
  if (pieces == "largest")
    choices.pieces = topology::PieceChoice::largest;
  else if (pieces == "all")
    choices.pieces = topology::PieceChoice::all;
  else if (pieces != "refuse")
    throw InputError(fmt::format("pieces: '{}'; allowed: refuse, largest, all", pieces));
  if (cavities == "fill")
    choices.cavities = topology::CavityChoice::fill;
  else if (cavities == "refuse")
    choices.cavities = topology::CavityChoice::refuse;
  else if (cavities != "keep")
    throw InputError(fmt::format("cavities: '{}'; allowed: keep, fill, refuse", cavities));
  return choices;
}

// (n, k) numbers of vertices, or a list of lists of any lengths.
std::vector<std::vector<int>> polygons_from(const py::object& given, std::size_t vertices) {
  std::vector<std::vector<int>> polygons;
  const auto count = static_cast<long>(vertices);
  if (!py::isinstance<py::array>(given)) {
    if (!py::isinstance<py::sequence>(given))
      throw InputError("polygons: neither an array nor a list; allowed: an array of shape (n, k), or a list of lists");
    for (const py::handle& polygon : given) {
      const py::array corners = py::array::ensure(polygon);
      if (!corners)
        throw py::error_already_set();
      polygons.push_back(indices_from(corners, "polygons", count));
    }
    return polygons;
  }
  const Integers flat = integers_from(py::reinterpret_borrow<py::array>(given), "polygons", 0, count);
  if (flat.shape.size() != 2)
    throw InputError(fmt::format("polygons: an array with {} axes; allowed: shape (n, k)", flat.shape.size()));
  const auto corners = static_cast<std::size_t>(flat.shape[1]);
  for (std::size_t first = 0; first < flat.values.size(); first += corners)
    polygons.emplace_back(flat.values.begin() + static_cast<std::ptrdiff_t>(first),
                          flat.values.begin() + static_cast<std::ptrdiff_t>(first + corners));
  return polygons;
}

topology::PolygonSoup soup_from(const Doubles& vertices, const py::object& polygons, const std::string& name) {
  topology::PolygonSoup soup;
  soup.vertices = points_from(vertices, "vertices");
  soup.polygons = polygons_from(polygons, soup.vertices.size());
  topology::require_readable(soup, name);
  return soup;
}

topology::LabelVolume volume_from(const py::array& labels, const Doubles& origin, const Doubles& axes) {
  if (labels.ndim() != 3)
    throw InputError(fmt::format("labels: an array with {} axes; allowed: shape (i, j, k)", labels.ndim()));
  topology::LabelVolume volume;
  const Integers values = integers_from(labels, "labels", -2147483648L, 2147483648L);
  for (std::size_t a = 0; a < 3; ++a)
    volume.size[a] = static_cast<int>(values.shape[a]);
  volume.origin = vector_from(origin, "origin");
  volume.axes = matrix_from(axes, "axes");
  if (!(std::abs(volume.axes.determinant()) > 0))
    throw InputError("axes: not independent; allowed: three columns that span space");
  volume.has_unit = true;
  volume.labels.resize(values.values.size());
  std::size_t at = 0; // the last index runs fastest here, the first in the volume
  const auto [ni, nj, nk] = volume.size;
  for (int i = 0; i < ni; ++i)
    for (int j = 0; j < nj; ++j)
      for (int k = 0; k < nk; ++k)
        volume.labels[(static_cast<std::size_t>(k) * static_cast<std::size_t>(nj) + static_cast<std::size_t>(j)) *
                          static_cast<std::size_t>(ni) +
                      static_cast<std::size_t>(i)] = values.values[at++];
  return volume;
}

void bind_mesh(py::module_& module) {
  py::class_<SurfaceMesh, std::shared_ptr<SurfaceMesh>>(
      module, "Surface", "A triangulated surface that does not change: vertices, m, and triangles.")
      .def(py::init([](const Doubles& vertices, const py::array& triangles) {
             SurfaceMesh mesh;
             mesh.vertices = points_from(vertices, "vertices");
             mesh.triangles = triangles_from(triangles, mesh.vertices.size());
             return std::make_shared<SurfaceMesh>(std::move(mesh));
           }),
           "vertices"_a, "triangles"_a,
           "vertices: (n, 3), m. triangles: (m, 3) numbers of vertices, counter-clockwise seen from outside. Both are "
           "copied. Nothing but ranges is checked: check_surface() mends what comes from elsewhere.")
      .def_property_readonly(
          "vertices", [](const py::object& self) { return view(self.cast<const SurfaceMesh&>().vertices, self); },
          "(n, 3), m; the surface's own memory, cannot be written to.")
      .def_property_readonly(
          "triangles", [](const py::object& self) { return view(self.cast<const SurfaceMesh&>().triangles, self); },
          "(m, 3) numbers of vertices; the surface's own memory, cannot be written to.")
      .def_property_readonly("volume", &topology::volume, "Enclosed volume, m3; negative when oriented inwards.")
      .def_property_readonly("area", &topology::area, "Area, m2.")
      .def_property_readonly(
          "bounds",
          [](const SurfaceMesh& mesh) {
            const BoundingBox box = topology::bounds(mesh);
            return owned(std::vector<Vector3>{box.lower, box.upper});
          },
          "(2, 3), m: least and greatest coordinates.")
      .def(
          "vertex_normals", [](const SurfaceMesh& mesh) { return owned(topology::vertex_normals(mesh)); },
          "(n, 3) unit normals at the vertices, weighted by area.")
      .def(
          "neighbours", [](const SurfaceMesh& mesh) { return owned(topology::triangle_neighbours(mesh)); },
          "(m, 3): for every triangle those across its edges v0v1, v1v2, v2v0; -1 on a border.")
      .def(
          "write",
          [](const SurfaceMesh& mesh, const std::filesystem::path& file) {
            unlocked([&] { topology::write_surface(file, mesh); });
          },
          "file"_a, "Writes OBJ or PLY, by the extension.")
      .def("__repr__",
           [](const SurfaceMesh& mesh) {
             return fmt::format("<spherecut.Surface: {} vertices, {} triangles>", mesh.vertices.size(),
                                mesh.triangles.size());
           })
      .def(py::pickle(
          [](const py::object& self) {
            const auto& mesh = self.cast<const SurfaceMesh&>();
            return py::make_tuple(view(mesh.vertices, self), view(mesh.triangles, self));
          },
          [](const py::tuple& state) {
            SurfaceMesh mesh;
            mesh.vertices = points_from(state[0].cast<Doubles>(), "vertices");
            mesh.triangles = triangles_from(state[1].cast<py::array>(), mesh.vertices.size());
            return std::make_shared<SurfaceMesh>(std::move(mesh));
          }));

  py::class_<CheckedSurface>(module, "CheckedSurface",
                             "A surface that mechanics can stand on: closed, 2-manifold, outward, free of "
                             "self-intersections; and what was done to make it so.")
      .def_property_readonly(
          "surface", [](const CheckedSurface& self) { return std::make_shared<SurfaceMesh>(self.mesh); },
          "The surface (a copy).")
      .def_readonly("mended", &CheckedSurface::mended, "A sentence for every kind of mending.")
      .def_readonly("warnings", &CheckedSurface::warnings, "About a surface that is sound but looks unintended.");
}

void bind_readers(py::module_& module) {
  module.def(
      "check_surface",
      [](const Doubles& vertices, const py::object& polygons, const std::string& name, const std::string& pieces,
         const std::string& cavities) {
        const topology::SurfaceChoices choices = choices_from(pieces, cavities);
        const topology::PolygonSoup soup = soup_from(vertices, polygons, name);
        return unlocked([&] { return topology::check_surface(soup, name, choices); });
      },
      "vertices"_a, "polygons"_a, "name"_a = "surface", "pieces"_a = "refuse", "cavities"_a = "keep",
      "Checks and mends polygons from anywhere. vertices: (n, 3), m. polygons: (m, k) numbers of vertices, or a list "
      "of lists. name: starts every error. pieces: 'refuse', 'largest' or 'all'. cavities: 'keep', 'fill' or "
      "'refuse'. Raises InputError with the place of what cannot be mended.");
  module.def(
      "read_surface",
      [](const std::filesystem::path& file, double scale, const std::string& pieces, const std::string& cavities) {
        const topology::SurfaceChoices choices = choices_from(pieces, cavities);
        return unlocked([&] { return topology::read_surface(file, scale, choices); });
      },
      "file"_a, "scale"_a = 1.0, "pieces"_a = "refuse", "cavities"_a = "keep",
      "check_surface() of an OBJ, PLY, STL, OFF, VTK or VTP file. scale: metres in a unit of the file.");
  module.def(
      "label_surface",
      [](const py::array& labels, const Doubles& origin, const Doubles& axes, std::optional<int> label,
         const std::string& name) {
        const topology::LabelVolume volume = volume_from(labels, origin, axes);
        return unlocked([&] {
          topology::LabelSurface surface = topology::label_surface(volume, label, name);
          CheckedSurface checked = topology::check_surface(surface.soup, name);
          checked.mended.insert(checked.mended.begin(), surface.remarks.begin(), surface.remarks.end());
          return checked;
        });
      },
      "labels"_a, "origin"_a, "axes"_a, "label"_a = py::none(), "name"_a = "labels",
      "Surface of the voxels of one label of a segmentation. labels: (i, j, k) whole numbers. origin: (3,), m, centre "
      "of voxel (0, 0, 0). axes: (3, 3), m; its columns lead from a voxel to the next along i, j and k. label: None "
      "takes the only one but 0. (SimpleITK's arrays are (k, j, i): transpose them.)");
}

void bind_organs(py::module_& module) {
  const auto shared = [](SurfaceMesh mesh) { return std::make_shared<SurfaceMesh>(std::move(mesh)); };
  module.def(
      "make_block",
      [shared](const Doubles& lower, const Doubles& upper, double edge) {
        const Vector3 low = vector_from(lower, "lower"), high = vector_from(upper, "upper");
        return unlocked([&] { return shared(topology::make_block(low, high, edge)); });
      },
      "lower"_a, "upper"_a, "edge"_a, "Surface of a box between two corners, (3,), m; edge: of its triangles, m.");
  module.def(
      "make_cylinder",
      [shared](double radius, double height, double edge) {
        return unlocked([&] { return shared(topology::make_cylinder(radius, height, edge)); });
      },
      "radius"_a, "height"_a, "edge"_a, "Surface of an upright cylinder on z = 0 about the z axis; all in m.");
  module.def(
      "make_hemisphere",
      [shared](double radius, double edge) {
        return unlocked([&] { return shared(topology::make_hemisphere(radius, edge)); });
      },
      "radius"_a, "edge"_a, "Surface of a half ball on z = 0 with its pole at +z; all in m.");
  module.def(
      "make_liver",
      [shared](int triangles) { return unlocked([&] { return shared(topology::make_liver(triangles)); }); },
      "triangles"_a = 20000,
      "Surface of a liver of adult size, 0.22 m wide, about 1.6 litres, dome at +z; 1000 to 500000 triangles.");
}

} // namespace

void bind_surface(py::module_& module) {
  bind_mesh(module);
  bind_readers(module);
  bind_organs(module);
}

} // namespace spherecut::bindings
