// A strip in pure shear as a scenario, and what its crack releases: for the experiment and for tests.
#pragma once

#include "solvers/elasticity/homogeneous.hpp"

#include <sstream>
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
    std::ostringstream out;
    out.precision(17);
    out << "[organ]\nshape = \"block\"\nsize = [" << length << ", " << height << ", " << thickness
        << "]\n[material]\nlaw = \"" << law << "\"\n"
        << constants << "\npoisson_ratio = " << poisson_ratio << "\npretension = [0, " << stretch - 1
        << ", 0]\ntoughness = " << toughness << '\n';
    clamp(out, -1);
    clamp(out, 1);
    out << "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 1e-6]\nnormal = [0, 0, 1]\naxes = [\"z\"]\n"
        << "[nodes]\nfine_spacing = " << fine << "\ncoarse_spacing = " << coarse << "\nrandom_seed = " << seed
        << "\n[[precut]]\nshape = \"rectangle\"\ncentre = [" << -0.5 * length << ", 0, " << 0.5 * thickness
        << "]\nnormal = [0, 1, 0]\nup = [0, 0, 1]\nwidth = " << 2 * crack << "\nheight = " << 2 * thickness
        << "\n[tearing]\n"
        << tearing;
    return out.str();
  }

 private:
  void clamp(std::ostream& out, int side) const {
    out << "[[fixed]]\nregion = \"half_space\"\npoint = [0, " << side * (0.5 * height - 1e-6) << ", 0]\nnormal = [0, "
        << -side << ", 0]\naxes = [\"x\", \"y\"]\n";
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
