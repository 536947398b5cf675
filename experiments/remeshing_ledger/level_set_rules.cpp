#include "experiments/remeshing_ledger/level_set_rules.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include <getfem/getfem_mesh_im_level_set.h>

namespace spherecut::experiments::ledger {

std::vector<CellRule> level_set_rules(const LevelSetCells& cells, int order, bool singular) {
  std::vector<CellRule> rules(cells.cells.size());
  if (cells.cells.empty())
    return rules;
  try {
    // GetFEM joins points by a tolerance of its own: lengths are told in sizes of a cell.
    const Vector3 origin = cells.corners[cells.cells[0][0]];
    const double scale = 1 / (cells.corners[cells.cells[0][1]] - origin).norm();
    getfem::mesh mesh;
    std::vector<bgeot::size_type> point(cells.corners.size());
    for (std::size_t i = 0; i < point.size(); ++i) {
      const Vector3 x = scale * (cells.corners[i] - origin);
      point[i] = mesh.add_point(bgeot::base_node(x.x(), x.y(), x.z()));
    }
    std::vector<bgeot::size_type> convex;
    for (const auto& c : cells.cells)
      convex.push_back(mesh.add_tetrahedron(point[c[0]], point[c[1]], point[c[2]], point[c[3]]));
    getfem::level_set cut(mesh, 1, true);
    cut.reinit();
    for (std::size_t e = 0; e < convex.size(); ++e) {
      const auto unknowns = cut.get_mesh_fem().ind_basic_dof_of_element(convex[e]);
      for (std::size_t k = 0; k < 4; ++k) {
        cut.values(0)[unknowns[k]] = scale * cells.primary[cells.cells[e][k]];
        cut.values(1)[unknowns[k]] = scale * cells.secondary[cells.cells[e][k]];
      }
    }
    getfem::mesh_level_set cut_mesh(mesh);
    cut_mesh.add_level_set(cut);
    cut_mesh.adapt();
    const auto regular = getfem::int_method_descriptor(fmt::format("IM_TETRAHEDRON({})", order));
    const auto at_front = singular ? getfem::int_method_descriptor("IM_PRODUCT(IM_TRIANGLE(4),IM_GAUSS1D(5))")
                                   : getfem::pintegration_method();
    getfem::mesh_im_level_set integration(cut_mesh, getfem::mesh_im_level_set::INTEGRATE_ALL, regular, at_front);
    integration.set_integration_method(mesh.convex_index(), regular);
    integration.adapt();
    for (std::size_t e = 0; e < convex.size(); ++e) {
      const auto method = integration.int_method_of_element(convex[e])->approx_method();
      const auto& c = cells.cells[e];
      const double volumes = std::abs((cells.corners[c[1]] - cells.corners[c[0]])
                                          .cross(cells.corners[c[2]] - cells.corners[c[0]])
                                          .dot(cells.corners[c[3]] - cells.corners[c[0]])); // six of them
      for (std::size_t q = 0; q < method->nb_points_on_convex(); ++q) {
        const auto& x = method->point(q);
        rules[e].place.push_back({1 - x[0] - x[1] - x[2], x[0], x[1], x[2]});
        rules[e].weight.push_back(method->coeff(q) * volumes);
      }
    }
  } catch (const std::logic_error& error) { // what GetFEM throws
    throw NumericalError(fmt::format("GetFEM's cut of {} cells failed: {}", cells.cells.size(), error.what()));
  }
  return rules;
}

} // namespace spherecut::experiments::ledger
