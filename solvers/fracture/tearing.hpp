// When and where the front of a cut moves by itself: linear elastic fracture mechanics at every point of the front.
#pragma once

#include "solvers/fracture/stress_intensity.hpp"

#include <limits>
#include <optional>

namespace spherecut::solvers {

/// Direction in which a front runs on, rad, in the plane across it: 0 ahead, positive to the + side of the sheet. The
/// direction of largest hoop stress [Erdogan and Sih 1963],
///
///   cos t = (3 K_II^2 + K_I sqrt(K_I^2 + 8 K_II^2)) / (K_I^2 + 9 K_II^2),  t against the sign of K_II,
///
/// +-70.5 degrees in pure mode II. K_III does not turn it. Faces that are pressed together (K_I < 0) do not open: K_I
/// then counts as zero.
double kink_angle(const Intensities& k);

/// G of the intensities that drive a tear, J/m2: as energy_release_rate(), K_I < 0 counting as zero.
double driving_release_rate(const Material& material, const Intensities& k);

/// One place of the front.
struct FrontState {
  topology::FrontFrame frame;
  Intensities intensities = Intensities::Zero(); // Pa sqrt(m)
  double release = 0;                            // G, J/m2
  double toughness = 0;                          // G_c there, J/m2
  double angle = 0;                              // kink_angle, rad
  bool by_integral = true;                       // there or near by; false: by the jump behind the front
};

/// The integrals along the front of one body, for every field on it; filled as they are asked for. Another body,
/// another cut or other nodes ask for another one.
struct FrontRules {
  double spacing = 0; // m, of the places along the front
  struct Place {
    bool asked = false;
    std::optional<IntensityRule> rule; // none: no tube fits there
  };
  std::vector<Place> places{};
};

/// Intensities along the whole front at places about `spacing` m apart, by interaction integral. Where its tube does
/// not fit (near the surface), those of the nearest place that has it within 3 node spacings, else by displacement
/// correlation. Faces that press on one another carry tractions which the integral does not know: where pairs of lip
/// nodes are in contact (`closed`, places of such pairs) behind the front within its tube, correlation it is.
/// `toughness` at a point of the body at rest, J/m2. `rules`: of this body, null: they are not kept. Throws InputError
/// when `spacing` or a toughness is not positive, NumericalError when the intensities cannot be had.
std::vector<FrontState> front_states(const Discretisation& body, const Field& field,
                                     const std::function<double(const Vector3&)>& toughness, double spacing,
                                     const std::vector<Vector3>& closed = {}, FrontRules* rules = nullptr);

/// In spacings: over how much of its way to the surface the shift of an integral fades at most, and how near to the
/// surface a front may come before nodes do not resolve its field.
inline constexpr double deepest_inset = 1, least_inset = 0.5;

/// How a body tells of a place of its front.
struct FrontProbe {
  /// By an integral; nothing where no tube fits. `place`: of the samples along the front.
  std::function<std::optional<Intensities>(std::size_t place, const topology::FrontFrame& frame)> by_integral;
  /// By the jump behind the front. Throws InputError where there is no room for it.
  std::function<Intensities(const topology::FrontFrame& frame)> by_jump;
};

/// The same of any body, asked at these places of its front.
std::vector<FrontState> front_states(const Problem& problem, const std::vector<topology::FrontFrame>& frames,
                                     const FrontProbe& probe, const std::function<double(const Vector3&)>& toughness,
                                     const std::vector<Vector3>& closed);

/// The states with intensities averaged along the front over about `length` m (standard deviation of the weight), and
/// what follows from them. Intensities scatter from place to place with the nodes; a front that followed that would
/// grow ragged. So would one whose places each took the mean with their own triangle's way ahead: what the field says
/// against that way is lost in the mean. Intensities of other places are turned into the way ahead of the one that they
/// are averaged for (those of a short kink at the angle between the two).
std::vector<FrontState> averaged(const Material& material, const std::vector<FrontState>& states, double length);

/// First share (0 to 1) of a way of loading at which G / G_c is `drive` anywhere along the front, its intensities going
/// evenly from those of `unloaded` to those of `loaded` (the same places), the toughness being that
/// of `loaded`: exact where the body answers in proportion to the load. 1 where it does not come to that. Throws
/// InputError unless there are as many places in both.
double onset_share(const Material& material, const std::vector<FrontState>& unloaded,
                   const std::vector<FrontState>& loaded, double drive);

/// Where a front turns to.
enum class TearDirection {
  weakest,     // largest release by hoop stress over the toughness that it meets there
  hoop_stress, // largest hoop stress, whatever the toughness: the same where that is uniform
};

/// The states turned to where the tissue gives way: with TearDirection::weakest the angle within 80 degrees at which
/// K_h(t)^2 / G_c is largest, K_h = cos(t/2) (K_I cos^2(t/2) - 3/2 K_II sin t) the opening intensity of a short kink
/// [Cotterell and Rice 1980] and G_c the toughness `probe` m ahead in that direction. Their toughness becomes that
/// which they meet there. Throws InputError when `probe` or a toughness is not positive.
std::vector<FrontState> directed(std::vector<FrontState> states, TearDirection rule,
                                 const std::function<double(const Vector3&)>& toughness, double probe);

/// How the front moves in one step of quasi-static growth: where G >= G_c by up to `longest` m, in proportion to
/// (G / G_c - 1) over its largest, never less than a tenth of it where G >= G_c; elsewhere not. Directions (in space,
/// not as angles against a place's own frame) and lengths between the places are averages over about `smoothing` m. The
/// states must not be empty.
///
/// The motions of places that move differ by at most `slope` m for each unit of G / G_c. A wave of length 2 pi / k and
/// height A on a straight front changes G by k A of itself [Rice 1985], so a slope of 1 / k flattens it in one step and
/// one beyond 2 / k makes it grow: a front that is averaged and smoothed over a spacing or so asks for slopes below
/// some five spacings.
std::function<Vector3(const topology::FrontFrame&)> tear_motion(std::vector<FrontState> states, double longest,
                                                                double smoothing,
                                                                double slope = std::numeric_limits<double>::infinity());

} // namespace spherecut::solvers
