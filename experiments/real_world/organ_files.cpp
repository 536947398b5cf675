#include "experiments/real_world/situations.hpp"

#include "topology/files/label_volume.hpp"
#include "topology/organ/organs.hpp"
#include "topology/organ/surface_check.hpp"

#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <numbers>

namespace spherecut::experiments::real_world {

namespace {

constexpr double side = 0.02; // m, of the cubes

topology::SurfaceMesh cube(const Vector3& lower, double size, double edge) {
  return topology::make_block(lower, lower + Vector3::Constant(size), edge);
}

topology::SurfaceMesh joined(topology::SurfaceMesh a, const topology::SurfaceMesh& b, bool turned = false) {
  const int offset = static_cast<int>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles)
    a.triangles.push_back(turned ? Triangle{t[0] + offset, t[2] + offset, t[1] + offset}
                                 : Triangle{t[0] + offset, t[1] + offset, t[2] + offset});
  return a;
}

/// Relative error of the volume of what is read from a file that holds this mesh.
double volume_error(const ExperimentContext& context, const std::string& name, const topology::SurfaceMesh& mesh,
                    double exact, const topology::SurfaceChoices& choices = {}) {
  topology::write_surface(context.out / name, mesh);
  return std::abs(topology::volume(topology::read_surface(context.out / name, 1, choices).mesh) / exact - 1);
}

std::vector<Check> segmentations(const ExperimentContext& context) {
  using topology::CavityChoice;
  using topology::PieceChoice;
  const double whole = std::pow(side, 3), hole = std::pow(0.4 * side, 3);
  const topology::SurfaceMesh body = cube(Vector3::Zero(), side, 0.2 * side);
  const topology::SurfaceMesh island = joined(body, cube(Vector3(1.5 * side, 0, 0), 0.1 * side, 0.1 * side));
  const topology::SurfaceMesh hollow = joined(body, cube(Vector3::Constant(0.3 * side), 0.4 * side, 0.2 * side), true);
  const topology::SurfaceMesh hinged = joined(body, cube(Vector3(side, side, 0), side, 0.2 * side));
  return {
      {"island_largest", volume_error(context, "island.obj", island, whole, {PieceChoice::largest, {}}), "<=", 1e-9},
      {"island_all",
       volume_error(context, "islands.obj", island, 1.001 * whole, {PieceChoice::all, CavityChoice::keep}), "<=", 1e-9},
      {"cavity_kept", volume_error(context, "hollow.obj", hollow, whole - hole), "<=", 1e-9},
      {"cavity_filled", volume_error(context, "filled.obj", hollow, whole, {PieceChoice::refuse, CavityChoice::fill}),
       "<=", 1e-9},
      {"edge_with_four_faces", volume_error(context, "hinged.obj", hinged, 2 * whole, {PieceChoice::all, {}}),
       "<=", 1e-3}};
}

/// A ball of voxels as a MetaImage; its surface against the ball.
Check label_volume(const ExperimentContext& context) {
  constexpr int count = 28;
  constexpr double radius = 11; // voxels of 1 x 1 x 1.25 mm
  std::string bytes = fmt::format("NDims = 3\nDimSize = {} {} {}\nElementSpacing = 1 1 1.25\nElementType = MET_UCHAR\n"
                                  "ElementDataFile = LOCAL\n",
                                  count, count, count);
  for (int k = 0; k < count; ++k)
    for (int j = 0; j < count; ++j)
      for (int i = 0; i < count; ++i)
        bytes += Vector3(i - 13.4, j - 13.3, 1.25 * (k - 13.6)).norm() < radius ? '\1' : '\0';
  std::ofstream(context.out / "ball.mha", std::ios::binary) << bytes;
  const topology::LabelSurface surface =
      topology::label_surface(topology::read_label_volume(context.out / "ball.mha"), std::nullopt, "ball.mha");
  const double exact = 4.0 / 3 * std::numbers::pi * std::pow(1e-3 * radius, 3);
  const double enclosed = topology::volume(topology::check_surface(surface.soup, "ball.mha").mesh);
  return {"label_volume", std::abs(enclosed / exact - 1), "<=", 0.02};
}

std::string pressed_cube(const std::string& file, const std::string& method, int seed) {
  return fmt::format(
      "[organ]\nshape = \"file\"\nfile = \"{}\"\n[material]\nyoung_modulus = 1e4\npoisson_ratio = 0.3\n"
      "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 5e-4]\nnormal = [0, 0, 1]\n"
      "[method]\nname = \"{}\"\n[nodes]\nfine_spacing = 0.002\ncoarse_spacing = 0.002\nrandom_seed = {}\n"
      "[tool]\nshape = \"sphere_tip\"\nradius = 0.008\nstep = 1\n[tool.approach]\n"
      "target = [0.01, 0.01, 0.02]\ndirection = [0, 0, -1]\ndepth = 0.001\n",
      file, method, seed);
}

/// Both methods on a cube from a file, over seeds: runs that fail, and how far the forces are apart.
std::vector<Check> methods_on_files(const ExperimentContext& context) {
  topology::write_surface(context.out / "cube.obj", cube(Vector3::Zero(), side, 0.2 * side));
  int failed = 0;
  double apart = 0;
  const int seeds = context.quick ? 3 : 10;
  for (int seed = 1; seed <= seeds; ++seed)
    try {
      const double galerkin = run_text(context, pressed_cube("cube.obj", "galerkin", seed)).last.force.norm();
      const double collocation = run_text(context, pressed_cube("cube.obj", "collocation", seed)).last.force.norm();
      context.say(fmt::format("seed {}: {:.5g} N by galerkin, {:.5g} N by collocation", seed, galerkin, collocation));
      apart = std::max(apart, std::abs(collocation / galerkin - 1));
    } catch (const std::exception& error) {
      context.say(fmt::format("seed {}: {}", seed, error.what()));
      ++failed;
    }
  return {{"collocation_seeds_failed", static_cast<double>(failed), "<=", 0}, {"methods_apart", apart, "<=", 0.05}};
}

} // namespace

std::vector<Check> organ_files(const ExperimentContext& context) {
  std::vector<Check> checks = segmentations(context);
  checks.push_back(label_volume(context));
  for (Check& check : methods_on_files(context))
    checks.push_back(std::move(check));
  return checks;
}

} // namespace spherecut::experiments::real_world
