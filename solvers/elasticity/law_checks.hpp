// What a law's constants say, and what they may be.
#pragma once

#include "solvers/elasticity/law.hpp"

#include <array>
#include <optional>

namespace spherecut::solvers {

/// The constants of a law as its model in this folder takes them.
struct LawConstants {
  std::array<double, 6> values{};
};
[[nodiscard]] LawConstants law_constants(const LawSpec& spec);
/// Frame of the law's own directions; zero where it has none.
[[nodiscard]] FibreFrame law_fibres(const LawSpec& spec);

/// A law from constants that nobody has looked at.
[[nodiscard]] std::unique_ptr<Law> make_law_unchecked(const LawSpec& spec);

/// Where a law first loses strong ellipticity: its acoustic tensor, Q_ik = A_ijkl n_j n_l, is no longer positive
/// definite.
struct EllipticityLoss {
  std::string path;  // how it is strained: "uniaxial tension", ...
  double strain = 0; // stretch - 1, the least in magnitude of all paths
};

/// Looks along five paths, pulled and pressed, from the rest state to stretches of `reach` and 1 / `reach` by steps of
/// at most 2 %: uniaxial, equibiaxial and pure shear, their free stretches such that no stress acts there (isotropic
/// laws) or no volume changes (fibres), equibiaxial to half as far in ln stretch, for its third stretch goes as far;
/// confined; and, to half as far, all around. Directions n: 184 over the half sphere. Loss between them is not seen.
[[nodiscard]] std::optional<EllipticityLoss> find_loss(const LawSpec& spec, double reach);

} // namespace spherecut::solvers
