// Borders of growing sheets, for strips that are to abut on them vertex by vertex. Used by the blade sweep alone.
#pragma once

#include "topology/surface_mesh.hpp"

#include <optional>

namespace spherecut::topology {

class SheetBorders {
 public:
  /// The nearer end, within `reach` m, of the border edge nearest to x; -1 where x is farther than `off` m from that.
  int nearest(const SurfaceMesh& sheet, int id, const Vector3& x, double off, double reach);

  /// Vertices strictly between two of the border, the shorter way along it, in order. Nothing when they lie on
  /// different borders or that way is longer than `longest` m.
  std::optional<std::vector<int>> between(const SurfaceMesh& sheet, int id, int from, int to, double longest);

 private:
  struct Border {
    std::size_t triangles = 0;       // of the sheet when it was found
    std::vector<int> next, previous; // by vertex, -1 inside
  };
  const Border& of(const SurfaceMesh& sheet, int id);
  std::vector<Border> borders_; // by sheet
};

} // namespace spherecut::topology
