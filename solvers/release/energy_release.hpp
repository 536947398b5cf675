// Energy release rate of a cut's front at finite strain, by a domain integral in the stress-free frame.
//
// A virtual shift xi = q e of the material about the front, e ahead, q = 1 there and 0 outside a tube, releases
// [Eshelby 1951; of a crack: Rice 1968, Maugin 1993]
//
//   G Q = -int (S : grad xi + xi . H^T b) dV + int_faces xi . S n dS,   S = W I - H^T P,   H = F - A,
//   Q = int q ds along the front,   b the body force, n out of the material.
//
// A is any constant: with H or F the integral is the same but for the divergence of P, which is zero in equilibrium. Of
// a discrete body it is zero to the error of its stress, first order in the strain where S is of second: with F the
// rate of a body strained by 0.1 % would be that error a thousand times, with F - I that of a flap which has turned. A
// here is the rotation R of the polar decomposition of the mean of F where the shift fades: the rate does not change as
// the body turns. Of a whole front, whose tube may reach a held surface that such an A would make work on, it is I.
#pragma once

#include "solvers/finite/body.hpp"

#include <optional>

namespace spherecut::solvers {

/// Whose pressure S has where the body takes that of blocks.
enum class ReleasePressure {
  blocks, // the one that its forces have. S is then the slope of the body's own energy as its points move:
          // U(J) goes over to s U(J) + (1 - s) [U(J_b) + U'(J_b) (J - J_b)]
  points, // of every point's own J
};

struct ReleaseOptions {
  /// Radii between which the shift fades, in spacings at the front. About a front that turns, a few of them are to fit
  /// into its radius of curvature.
  double inner = 1, outer = 4;
  /// Of the tube along the front, in spacings, where the shift fades to both sides. Empty: the shift is that of the
  /// whole front, and the result its mean.
  std::optional<double> half_length = 2;
  /// Spacings from the surface within which the shift fades to nothing; 0: it does not. The tube then must not leave
  /// the body, but the one of a whole front may where the surface is parallel to the way ahead, free or held along its
  /// normal alone.
  double inset = 0;
  ReleasePressure pressure = ReleasePressure::blocks;
};

struct EnergyRelease {
  double rate = 0;   // G, J per m2 of the stress-free sheet
  double length = 0; // Q, m
};

/// F, W and P at every point of a deformed body.
class EnergyMomentum {
 public:
  /// The body outlives it. `fibres`: as the body was given them. Throws InputError for coefficients of another number,
  /// for a state with some J <= 0 that the law cannot be asked about, and for a viscoelastic body: what has faded has
  /// no energy that the integral could take.
  EnergyMomentum(const FiniteBody& body, const VectorX& coefficients,
                 const std::function<FibreFrame(const Vector3& x)>& fibres = nullptr);

  /// At a place of the front. `load_factor`: of the problem's loads. Throws InputError without a cut, where the tube
  /// leaves the body though it must not, where the front turns within it, and for radii and lengths out of order.
  [[nodiscard]] EnergyRelease at(const topology::FrontFrame& front, const ReleaseOptions& options = {},
                                 double load_factor = 1) const;
  /// Mean over the whole front, half_length left out. Throws as at().
  [[nodiscard]] EnergyRelease mean(const ReleaseOptions& options = {}, double load_factor = 1) const;

 private:
  struct Shift; // q, the way ahead, and their gradients
  struct FacePlace;
  class LocalShift;
  /// `about`: A; where there is none it becomes the rotation of the mean of F.
  template <class ShiftAt>
  [[nodiscard]] EnergyRelease integrate(const ShiftAt& shift_at, ReleasePressure pressure, double load_factor,
                                        std::optional<Matrix3>& about) const;
  void add_faces(const std::vector<FacePlace>& places, const Matrix3& about, double load_factor,
                 EnergyRelease& sum) const;

  const FiniteBody& body_;
  VectorX coefficients_;
  std::vector<Matrix3> deformations_;                  // F of every point of the table
  std::vector<double> of_blocks_, of_points_;          // W of each, J/m3
  std::vector<Matrix3> blocks_stress_, points_stress_; // P of each, Pa
};

} // namespace spherecut::solvers
