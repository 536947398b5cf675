// The palpation of a hemisphere (see ../reference.hpp) with 27-node bricks of GetFEM.
//
//   spherecut_reference_getfem POISSON_RATIO OUT.csv
//
// Refines until force and surface displacement change by less than 0.15 percent and writes the table that
// ../reference.cpp reads. One quarter of the body is meshed; the planes x = 0 and y = 0 are planes of symmetry.
#include "experiments/hemisphere_palpation/reference.hpp"
#include "experiments/hemisphere_palpation/reference_getfem/half_ball_mesh.hpp"
#include "solvers/elasticity/material.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/CholmodSupport>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <numbers>

#include <getfem/getfem_assembling.h>
#include <getfem/getfem_mesh_fem.h>
#include <getfem/getfem_mesh_im.h>
#include <gmm/gmm.h>

using namespace spherecut;
using namespace spherecut::experiments;

namespace {

using Sparse = Eigen::SparseMatrix<double>;

constexpr double tolerance = 1.5e-3, on_surface = 1e-9;

/// Stiffness matrix on the points of the mesh, unknown 3 * point + component. GetFEM joins unknowns of neighbouring
/// elements by a tolerance relative to the size of the element, which fuses nodes of the thin bricks at the edge of the
/// cap; so the elements are assembled unconnected and joined here by the points of the mesh, which it keeps apart.
Sparse stiffness(const getfem::mesh& mesh, const solvers::Material& material) {
  getfem::mesh_fem elements(mesh, 3), data(mesh, 1);
  elements.set_finite_element(getfem::fem_descriptor("FEM_QK_DISCONTINUOUS(3,2)"));
  data.set_finite_element(getfem::fem_descriptor("FEM_QK(3,0)"));
  getfem::mesh_im integration(mesh);
  integration.set_integration_method(getfem::int_method_descriptor("IM_GAUSS_PARALLELEPIPED(3,5)"));
  gmm::col_matrix<gmm::wsvector<double>> assembled(elements.nb_dof(), elements.nb_dof());
  const std::vector<double> lambda(data.nb_dof(), material.lame_lambda()), mu(data.nb_dof(), material.shear_modulus());
  getfem::asm_stiffness_matrix_for_linear_elasticity(assembled, integration, elements, data, lambda, mu);

  std::vector<int> unknown(elements.nb_dof(), -1);
  for (dal::bv_visitor brick(mesh.convex_index()); !brick.finished(); ++brick) {
    const auto& points = mesh.ind_points_of_convex(brick);
    const auto dofs = elements.ind_basic_dof_of_element(brick);
    for (std::size_t i = 0; i < dofs.size(); ++i) {
      const std::size_t point = points[i / 3];
      if (gmm::vect_dist2(mesh.points()[point], elements.point_of_basic_dof(dofs[i])) > 0)
        throw NumericalError(fmt::format("hemisphere: unknown {} of brick {} is not on its point", i, size_t{brick}));
      unknown[dofs[i]] = static_cast<int>(3 * point + i % 3);
    }
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t j = 0; j < elements.nb_dof(); ++j) {
    for (const auto& [i, value] : assembled.col(j))
      entries.emplace_back(unknown[i], unknown[j], value);
    gmm::clear(assembled.col(j));
  }
  const auto n = static_cast<Eigen::Index>(3 * mesh.nb_points());
  Sparse K(n, n);
  K.setFromTriplets(entries.begin(), entries.end());
  return K;
}

/// Solves K u = 0 with the held entries of u given; fills the others. Returns K u.
VectorX solve_with_held(const Sparse& K, const std::vector<char>& held, VectorX& u) {
  std::vector<int> index(held.size(), -1);
  int unknowns = 0;
  for (std::size_t k = 0; k < held.size(); ++k)
    if (held[k] == 0)
      index[k] = unknowns++;
  const VectorX load = -(K * u);
  VectorX right(unknowns);
  std::vector<Eigen::Triplet<double>> entries;
  for (int j = 0; j < K.cols(); ++j) {
    if (index[j] < 0)
      continue;
    right[index[j]] = load[j];
    for (Sparse::InnerIterator it(K, j); it; ++it)
      if (index[it.row()] >= index[j])
        entries.emplace_back(index[it.row()], index[j], it.value());
  }
  Sparse lower(unknowns, unknowns);
  lower.setFromTriplets(entries.begin(), entries.end());
  Eigen::CholmodSupernodalLLT<Sparse, Eigen::Lower> factor;
  factor.cholmod().nmethods = 1;
  factor.cholmod().method[0].ordering = CHOLMOD_METIS;
  factor.compute(lower);
  if (factor.info() != Eigen::Success)
    throw NumericalError(fmt::format("hemisphere: {} unknowns could not be factored", unknowns));
  const VectorX solution = factor.solve(right);
  for (std::size_t k = 0; k < held.size(); ++k)
    if (index[k] >= 0)
      u[static_cast<Eigen::Index>(k)] = solution[index[k]];
  return K * u;
}

HemisphereReference solve(double poisson_ratio, const HalfBallResolution& resolution) {
  const std::vector<Brick> bricks = half_ball_mesh(resolution, hemisphere_cap_radius);
  const double volume = checked_volume(bricks), exact_volume = std::numbers::pi / 6;
  fmt::print("  {} bricks, volume {:+.1e} of exact\n", bricks.size(), volume / exact_volume - 1);
  std::fflush(stdout);

  getfem::mesh mesh;
  const auto shape = bgeot::geometric_trans_descriptor("GT_QK(3,2)");
  for (const Brick& brick : bricks) {
    std::vector<bgeot::base_node> points;
    for (const Vector3& x : brick)
      points.emplace_back(x.x(), x.y(), x.z());
    mesh.add_convex_by_points(shape, points.begin());
  }
  const Sparse K = stiffness(mesh, {1, poisson_ratio, 0});
  std::vector<Vector3> nodes;
  for (std::size_t node = 0; node < mesh.nb_points(); ++node)
    nodes.emplace_back(mesh.points()[node][0], mesh.points()[node][1], mesh.points()[node][2]);

  const double cap_angle = std::asin(hemisphere_cap_radius);
  std::vector<char> held(3 * nodes.size(), 0);
  VectorX u = VectorX::Zero(K.rows());
  std::vector<std::size_t> cap, profile;
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    const Vector3& x = nodes[node];
    const bool surface = std::abs(x.norm() - 1) < on_surface;
    const bool base = x.z() < on_surface;
    const bool capped = surface && std::atan2(std::hypot(x.x(), x.y()), x.z()) < cap_angle + on_surface;
    for (int c = 0; c < 3; ++c)
      held[3 * node + c] = base || capped || (c < 2 && std::abs(x[c]) < on_surface);
    if (capped) {
      u[static_cast<Eigen::Index>(3 * node + 2)] = -1;
      cap.push_back(node);
    }
    if (surface && std::abs(x.y()) < on_surface)
      profile.push_back(node);
  }
  const VectorX force = solve_with_held(K, held, u);

  HemisphereReference result;
  result.source = fmt::format("GetFEM 27-node bricks, {} elements and {} unknowns in a quarter", bricks.size(),
                              std::ranges::count(held, 0));
  result.poisson_ratio = poisson_ratio;
  for (const std::size_t node : cap)
    result.force -= 4 * force[static_cast<Eigen::Index>(3 * node + 2)];
  const auto angle = [&](std::size_t node) { return std::atan2(nodes[node].x(), nodes[node].z()); };
  std::ranges::sort(profile, {}, angle);
  for (const std::size_t node : profile) {
    result.angle.push_back(angle(node));
    result.radial.push_back(u[static_cast<Eigen::Index>(3 * node)]);
    result.axial.push_back(u[static_cast<Eigen::Index>(3 * node + 2)]);
  }
  for (std::size_t k = 0; k + 2 < result.angle.size(); k += 2)
    if (std::abs(result.angle[k] - 2 * result.angle[k + 1] + result.angle[k + 2]) > on_surface)
      throw NumericalError(fmt::format("hemisphere: middle node at angle {} is off the middle", result.angle[k + 1]));

  double scatter = 0; // between the profile at y = 0 and the rest of the surface
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    if (std::abs(nodes[node].norm() - 1) < on_surface)
      scatter = std::max(scatter,
                         (result.displacement(nodes[node]) - u.segment<3>(static_cast<Eigen::Index>(3 * node))).norm());
  }
  fmt::print("  {}: force {:.8f} N, scatter about the axis {:.1e} m\n", result.source, result.force, scatter);
  std::fflush(stdout);
  return result;
}

HemisphereReference refined(double poisson_ratio) {
  HemisphereReference coarse;
  for (int k = 1; k <= 4; ++k) {
    HemisphereReference fine = solve(poisson_ratio, {k, 3 * k, 4 * k, 4 * k, 2 * k});
    if (k > 1) {
      fine.force_change = std::abs(fine.force / coarse.force - 1);
      fine.surface_change = largest_difference(coarse, fine);
      fmt::print("  change {:.2e} of the force, {:.2e} m of the surface\n", fine.force_change, fine.surface_change);
      if (k > 2 && fine.force_change < tolerance && fine.surface_change < tolerance)
        return fine;
    }
    coarse = std::move(fine);
  }
  throw NumericalError(fmt::format("hemisphere: not converged to {}", tolerance));
}

void write(const HemisphereReference& reference, const std::string& nu, const std::string& file) {
  std::ofstream out(file);
  fmt::memory_buffer text;
  fmt::format_to(
      std::back_inserter(text),
      "# made by: cmake --preset release -DSPHERECUT_BUILD_REFERENCES=ON && ninja -C build/release "
      "spherecut_reference_getfem && build/release/spherecut_reference_getfem {} "
      "experiments/hemisphere_palpation/{}\n"
      "# source: {}\n# poisson_ratio: {}\n# force: {:.9g}\n# force_change: {:.3g}\n# surface_change: {:.3g}\n"
      "angle,radial,axial\n",
      nu, file.substr(file.find_last_of('/') + 1), reference.source, nu, reference.force, reference.force_change,
      reference.surface_change);
  for (std::size_t k = 0; k < reference.angle.size(); ++k)
    fmt::format_to(std::back_inserter(text), "{:.12g},{:.9g},{:.9g}\n", reference.angle[k], reference.radial[k],
                   reference.axial[k]);
  out << fmt::to_string(text);
  out.close();
  if (!out)
    throw InputError(fmt::format("{}: cannot be written", file));
}

} // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 3)
      throw InputError("usage: spherecut_reference_getfem POISSON_RATIO OUT.csv");
    const std::string nu = argv[1];
    write(refined(std::stod(nu)), nu, argv[2]);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}
