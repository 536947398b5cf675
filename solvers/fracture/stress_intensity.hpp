// Stress intensity factors along the front of a cut, and the fields that they stand for.
#pragma once

#include "solvers/body/discretisation.hpp"

namespace spherecut::solvers {

/// (K_I, K_II, K_III), Pa sqrt(m). Positive: the + face moves along the normal, ahead, and along the tangent of the
/// front.
using Intensities = Vector3;

/// Singular field at a straight front in plane strain [Williams 1957], in axes (ahead, normal, tangent) of FrontFrame.
struct TipField {
  Vector3 displacement = Vector3::Zero(); // m
  Matrix3 gradient = Matrix3::Zero();     // du_i/dx_j
};
TipField tip_field(const Material& material, const Intensities& k, double ahead, double above);

/// G = (K_I^2 + K_II^2)(1 - nu^2)/E + K_III^2/(2 mu), J/m2.
double energy_release_rate(const Material& material, const Intensities& k);

/// Intensities at the tip of a short kink off a front, in the plane across it; `angle` rad, positive to the + side
/// [Cotterell and Rice 1980].
Intensities at_kink(const Intensities& k, double angle);

/// Angle from the way ahead of `frame` to a direction, rad, in the plane across the front, positive to the + side.
double angle_across(const topology::FrontFrame& frame, const Vector3& direction);

/// Frames of points along the front, about `spacing` m apart and no nearer than `margin` m to the surface of the body.
std::vector<topology::FrontFrame> front_samples(const topology::Incision& incision, double spacing, double margin = 0);

/// The jump u+ - u- at distances s = h .. 4 h behind the front, components (normal, ahead, tangent) fitted by
/// A s^(1/2) + B s^(3/2): K from A. The components are those of the sheet as it lies there, in the mean; where the
/// front has turned since, it is taken as the tip of a short kink (at_kink()): a front that followed the jump in its
/// own axes would turn back by twice the angle, and so from side to side.
struct CorrelationOptions {
  double from = 1, to = 4; // in units of the node spacing at the front
  int samples = 9;
};
Intensities displacement_correlation(const Discretisation& body, const Field& field, const topology::FrontFrame& front,
                                     const CorrelationOptions& options = {});
/// The same of any body, whose jump u+ - u- between two points beside the sheet, m, `jump` gives.
Intensities displacement_correlation(const Problem& problem, const topology::FrontFrame& front,
                                     const std::function<Vector3(const Vector3& plus, const Vector3& minus)>& jump,
                                     const CorrelationOptions& options = {});

/// Interaction integral over a tube around the front, with the terms for loaded faces, body forces and the front's
/// curvature in the plane of the cut (which is taken as flat within the tube). K = E'/2 I for the first two modes, mu I
/// for the third.
struct InteractionOptions {
  double inner = 0.5, outer = 3; // radii between which the virtual shift fades, in units of the spacing at the front
  double half_length = 2; // of the tube along the front, in the same units; down to 1 where it would leave the body or
                          // the front turns by much along it
  int radial = 16, around = 24, along = 6; // points; over the points of a weak form those of the faces alone
};
/// Throws InputError when the tube leaves the body.
Intensities interaction_integral(const Discretisation& body, const Field& field, const topology::FrontFrame& front,
                                 const InteractionOptions& options = {});

/// The interaction integral at one place of the front of a body as a linear function of the field: shape functions and
/// sight lines at the points of the tube are found once for all fields on the body.
struct IntensityRule {
  std::vector<int> nodes;
  std::vector<Matrix3> coefficients;       // by node: row m gives the intensity of mode m
  std::vector<Vector3> pressures;          // by node, of fields that have pressures; else empty
  Intensities loads = Intensities::Zero(); // what the loads add at load factor 1
  /// Throws InputError when the field has pressures and the rule none, or the other way round.
  [[nodiscard]] Intensities operator()(const Field& field) const;
};
/// `with_pressure`: whether the fields have pressures. Throws as interaction_integral(), and InputError where the
/// method has no spheres.
IntensityRule interaction_rule(const Discretisation& body, bool with_pressure, const topology::FrontFrame& front,
                               const InteractionOptions& options = {});

} // namespace spherecut::solvers
