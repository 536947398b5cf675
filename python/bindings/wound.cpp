// The surface of an organ after its cut.
#include "topology/wound/wound.hpp"
#include "python/bindings/floors.hpp"
#include "python/bindings/shared.hpp"

#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using topology::IncrementalWound;
using topology::SurfaceMesh;
using topology::Wound;

std::vector<SurfaceMesh> sheets_from(const std::vector<std::shared_ptr<SurfaceMesh>>& given) {
  std::vector<SurfaceMesh> sheets;
  sheets.reserve(given.size());
  for (const auto& sheet : given)
    sheets.push_back(*sheet);
  return sheets;
}

template <class T>
auto wound_view(const std::vector<T> Wound::*member) {
  return [member](const py::object& self) { return view(self.cast<const Wound&>().*member, self); };
}

} // namespace

void bind_wound(py::module_& module) {
  py::class_<Wound, std::shared_ptr<Wound>>(
      module, "Wound",
      "The surface of an organ after a cut: closed and 2-manifold, with lips and walls at every sheet.")
      .def_property_readonly(
          "vertices", [](const py::object& self) { return view(self.cast<const Wound&>().surface.vertices, self); },
          "(n, 3), m; the wound's own memory, as the other arrays, cannot be written to.")
      .def_property_readonly(
          "triangles", [](const py::object& self) { return view(self.cast<const Wound&>().surface.triangles, self); },
          "(m, 3) numbers of vertices.")
      .def_property_readonly(
          "surface", [](const Wound& self) { return std::make_shared<SurfaceMesh>(self.surface); },
          "The same as a Surface (a copy).")
      .def_property_readonly(
          "part",
          [](const Wound& self) {
            std::vector<std::uint8_t> parts;
            for (const topology::WoundPart part : self.part)
              parts.push_back(static_cast<std::uint8_t>(part));
            return owned(std::move(parts));
          },
          "(m,): 0 organ, 1 wall of the material on the + side of its sheet, 2 on the - side.")
      .def_property_readonly("sheet", wound_view(&Wound::sheet), "(m,): the sheet of a wall, -1 on the organ.")
      .def_property_readonly("source_triangle", wound_view(&Wound::source_triangle),
                             "(m,): the triangle of the organ or of the sheet that it is part of.")
      .def_property_readonly(
          "piece",
          [](const Wound& self) {
            std::vector<int> pieces;
            for (std::size_t t = 0; t < self.component.size(); ++t)
              pieces.push_back(self.piece_of(static_cast<int>(t)));
            return owned(std::move(pieces));
          },
          "(m,): the piece of material that it bounds.")
      .def_property_readonly("point", wound_view(&Wound::point), "(n,): copies of one point of the cut share a number.")
      .def_property_readonly("evaluation", wound_view(&Wound::evaluation),
                             "(n, 3), m: where a field is evaluated for a vertex, moved off the walls into its side.")
      .def_property_readonly(
          "volumes",
          [](const Wound& self) {
            std::vector<double> volumes;
            for (const topology::WoundPiece& piece : self.pieces)
              volumes.push_back(piece.volume);
            return owned(std::move(volumes));
          },
          "(pieces,), m3.")
      .def(
          "lip_pairs",
          [](const Wound& self) {
            std::vector<std::array<int, 2>> pairs;
            for (const topology::LipPair& pair : topology::lip_pairs(self))
              pairs.push_back({pair.plus, pair.minus});
            return owned(std::move(pairs));
          },
          "(k, 2): vertices of facing walls at one place, on the + and on the - side.")
      .def("__repr__", [](const Wound& self) {
        return fmt::format("<spherecut.Wound: {} triangles, {} pieces>", self.surface.triangles.size(),
                           self.pieces.size());
      });
  module.def(
      "cut_surface",
      [](const SurfaceMesh& organ, const std::vector<std::shared_ptr<SurfaceMesh>>& sheets) {
        const std::vector<SurfaceMesh> all = sheets_from(sheets);
        return unlocked([&] { return std::make_shared<Wound>(topology::cut_surface(organ, all)); });
      },
      "organ"_a, "sheets"_a, "Wound of sheets in the closed surface of an organ.");
  py::class_<IncrementalWound>(module, "IncrementalWound", "A wound that follows growing sheets.")
      .def(py::init([](const SurfaceMesh& organ) {
             return unlocked([&] { return std::make_unique<IncrementalWound>(organ); });
           }),
           "organ"_a)
      .def(
          "grow",
          [](IncrementalWound& self, const std::vector<std::shared_ptr<SurfaceMesh>>& sheets) {
            const std::vector<SurfaceMesh> all = sheets_from(sheets);
            const auto growth = unlocked([&] { return self.grow(all); });
            return py::dict("crossed"_a = growth.crossed, "rebuilt"_a = growth.rebuilt);
          },
          "sheets"_a,
          "The sheets now: each begins with the triangles it had, new sheets follow the old. Returns a dict: triangles "
          "crossed and rebuilt.")
      .def_property_readonly(
          "wound", [](const IncrementalWound& self) { return std::make_shared<Wound>(self.wound()); },
          "The Wound now (a copy).");
}

} // namespace spherecut::bindings
