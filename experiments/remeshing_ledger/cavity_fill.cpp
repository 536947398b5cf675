#include "experiments/remeshing_ledger/cavity_fill.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

#define TETLIBRARY
#include <tetgen.h>

namespace spherecut::experiments::ledger {

TetMesh fill_cavity(const CavityBorder& border) {
  const int count = static_cast<int>(border.points.size()), faces = static_cast<int>(border.triangles.size());
  // tetgenio frees with delete[] what it is given.
  tetgenio in, out;
  in.firstnumber = 0;
  in.numberofpoints = count;
  in.pointlist = new REAL[3 * border.points.size()];
  in.numberofpointmtrs = 1;
  in.pointmtrlist = new REAL[border.points.size()];
  for (int i = 0; i < count; ++i) {
    for (int d = 0; d < 3; ++d)
      in.pointlist[3 * i + d] = border.points[i][d];
    in.pointmtrlist[i] = border.sizes[i];
  }
  in.numberoffacets = faces;
  in.facetlist = new tetgenio::facet[border.triangles.size()];
  in.facetmarkerlist = new int[border.triangles.size()];
  for (int i = 0; i < faces; ++i) {
    tetgenio::facet& facet = in.facetlist[i];
    tetgenio::init(&facet);
    facet.numberofpolygons = 1;
    facet.polygonlist = new tetgenio::polygon[1];
    tetgenio::polygon& polygon = facet.polygonlist[0];
    tetgenio::init(&polygon);
    polygon.numberofvertices = 3;
    polygon.vertexlist = new int[3];
    std::copy(border.triangles[i].begin(), border.triangles[i].end(), polygon.vertexlist);
    in.facetmarkerlist[i] = i + 1; // facets of different marks are not merged
  }
  // Tetrahedra of the surface's inside; facets stay; edges by the sizes at the points; radius over shortest edge.
  std::string switches = "pYmq1.6zQ";
  try {
    tetrahedralize(switches.data(), &in, &out);
  } catch (int code) {
    throw NumericalError(fmt::format("TetGen ended with code {}", code));
  }
  TetMesh mesh;
  if (out.numberofpoints < count || out.numberoftetrahedra == 0)
    throw NumericalError(fmt::format("TetGen gave {} tetrahedra and {} points of {}", out.numberoftetrahedra,
                                     out.numberofpoints, count));
  for (int i = 0; i < out.numberofpoints; ++i)
    mesh.vertices.emplace_back(out.pointlist[3 * i], out.pointlist[3 * i + 1], out.pointlist[3 * i + 2]);
  for (int i = 0; i < count; ++i)
    if (mesh.vertices[i] != border.points[i])
      throw NumericalError(fmt::format("TetGen moved point {}", i));
  for (int t = 0; t < out.numberoftetrahedra; ++t) {
    const int* corner = out.tetrahedronlist + static_cast<std::ptrdiff_t>(t) * out.numberofcorners;
    std::array<int, 4> tet{corner[0], corner[1], corner[2], corner[3]};
    if (six_volumes(mesh.vertices[tet[0]], mesh.vertices[tet[1]], mesh.vertices[tet[2]], mesh.vertices[tet[3]]) < 0)
      std::swap(tet[2], tet[3]);
    mesh.tets.push_back(tet);
  }
  return mesh;
}

bool has_cavity_mesher() {
  return true;
}

} // namespace spherecut::experiments::ledger
