// A strip in pure shear as a scenario, and what its crack releases: for the experiment and for tests.
#pragma once

#include "solvers/elasticity/homogeneous.hpp"

#include <fmt/format.h>
#include <string>

namespace spherecut::experiments {

/// Given as stretched between clamps along its long sides, one half of it on its plane of symmetry; a crack along its
/// middle from one end.
struct StripScenario {
  std::string law, constants; // lines of the material
  double poisson_ratio = 0.45;
  double stretch = 1.3, toughness = 1;                                // J/m2 of the strip as it is given
  double height = 0.05, length = 0.2, thickness = 0.02, crack = 0.08; // m; thickness: of the half
  double fine = 0.006, coarse = 0.012;                                // m, between nodes
  std::uint64_t seed = 1;
  std::string tearing; // lines

  [[nodiscard]] std::string text() const {
    return fmt::format(R"([organ]
shape = "block"
size = [{}, {}, {}]
[material]
law = "{}"
{}
poisson_ratio = {}
pretension = [0, {}, 0]
toughness = {}
)",
                       length, height, thickness, law, constants, poisson_ratio, stretch - 1, toughness) +
           clamp(-1) + clamp(1) +
           fmt::format(R"([[fixed]]
region = "half_space"
point = [0, 0, 1e-6]
normal = [0, 0, 1]
axes = ["z"]
[nodes]
fine_spacing = {}
coarse_spacing = {}
random_seed = {}
[[precut]]
shape = "rectangle"
centre = [{}, 0, {}]
normal = [0, 1, 0]
up = [0, 0, 1]
width = {}
height = {}
[tearing]
{})",
                       fine, coarse, seed, -0.5 * length, 0.5 * thickness, 2 * crack, 2 * thickness, tearing);
  }

 private:
  [[nodiscard]] std::string clamp(int side) const {
    return fmt::format("[[fixed]]\nregion = \"half_space\"\npoint = [0, {}, 0]\nnormal = [0, {}, 0]\naxes = [\"x\", "
                       "\"y\"]\n",
                       side * (0.5 * height - 1e-6), -side);
  }
};

/// W H, J per m2 of the strip as it is given, with W the law's energy in pure shear [Rivlin and Thomas 1953].
inline double strip_release(const solvers::LawSpec& law, double stretch, double height) {
  const Matrix3 gradient = solvers::homogeneous::pure_shear(law, stretch).gradient;
  double energy = 0;
  Matrix3 stress;
  solvers::make_law(law)->evaluate({&gradient, 1}, {}, {&energy, 1}, {&stress, 1});
  return energy / stretch * height;
}

} // namespace spherecut::experiments
