#include "solvers/fracture/tearing.hpp"

#include "solvers/fracture/inset_integral.hpp"
#include "solvers/fracture/local_values.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <utility>

namespace spherecut::solvers {

using topology::FrontFrame;

double kink_angle(const Intensities& k) {
  const double one = std::max(0.0, k[0]), two = k[1];
  const double size = one * one + 9 * two * two;
  if (two == 0 || !(size > 0))
    return 0;
  const double cosine = (3 * two * two + one * std::sqrt(one * one + 8 * two * two)) / size;
  return -std::copysign(std::acos(std::clamp(cosine, -1.0, 1.0)), two);
}

double driving_release_rate(const Material& material, const Intensities& k) {
  return energy_release_rate(material, {std::max(0.0, k[0]), k[1], k[2]});
}

namespace {

constexpr int along_inset = 8; // points along the front where the shift varies fast

/// The integral over the usual tube, or a smaller one, or what of the usual one lies in the body; none when the front
/// is too near to the surface for any.
std::optional<IntensityRule> rule_at(const Discretisation& body, bool with_pressure, const FrontFrame& frame) {
  for (const InteractionOptions& tube :
       {InteractionOptions{}, InteractionOptions{.outer = 2, .half_length = 0.5},
        InteractionOptions{.inner = 0.3, .outer = 1.2, .half_length = 0.5}}) { // in flaps two spacings thick
    try {
      return interaction_rule(body, with_pressure, frame, tube);
    } catch (const InputError&) { // the tube leaves the body, or the front turns within it
    }
  }
  const Problem& problem = body.problem();
  const double depth = -problem.domain->signed_distance(frame.point) / spacing_at(problem.nodes, frame.point);
  if (depth < least_inset)
    return std::nullopt;
  try {
    return inset_rule(body, with_pressure, frame, std::min(depth, deepest_inset),
                      {.half_length = std::min(InteractionOptions{}.half_length, depth), .along = along_inset});
  } catch (const InputError&) { // too near to the surface, or the front turns within the tube
  }
  return std::nullopt;
}

/// Whether faces are in contact behind the front where the tube of the integral passes.
bool presses_behind(const Problem& problem, const FrontFrame& frame, const std::vector<Vector3>& closed) {
  if (closed.empty())
    return false;
  const double reach = InteractionOptions{}.outer * spacing_at(problem.nodes, frame.point);
  return std::any_of(closed.begin(), closed.end(), [&](const Vector3& x) {
    const Vector3 d = x - frame.point;
    return d.norm() < reach && d.dot(frame.ahead) < 0;
  });
}

} // namespace

std::vector<FrontState> front_states(const Discretisation& body, const Field& field,
                                     const std::function<double(const Vector3&)>& toughness, double spacing,
                                     const std::vector<Vector3>& closed, FrontRules* rules) {
  const Problem& problem = body.problem();
  if (problem.incision == nullptr)
    throw InputError("tearing: the body has no cut");
  const std::vector<FrontFrame> frames = front_samples(*problem.incision, spacing);
  FrontRules once;
  if (rules == nullptr)
    rules = &once;
  if (rules->spacing != spacing || rules->places.size() != frames.size())
    *rules = {spacing, std::vector<FrontRules::Place>(frames.size())};
  const auto by_integral = [&](std::size_t f, const FrontFrame& frame) -> std::optional<Intensities> {
    FrontRules::Place& place = rules->places[f];
    if (!place.asked) {
      place.rule = rule_at(body, field.pressure.size() > 0, frame);
      place.asked = true;
    }
    return place.rule ? std::optional<Intensities>((*place.rule)(field)) : std::nullopt;
  };
  const auto by_jump = [&](const FrontFrame& frame) { return displacement_correlation(body, field, frame); };
  return front_states(problem, frames, {by_integral, by_jump}, toughness, closed);
}

std::vector<FrontState> front_states(const Problem& problem, const std::vector<FrontFrame>& frames,
                                     const FrontProbe& probe, const std::function<double(const Vector3&)>& toughness,
                                     const std::vector<Vector3>& closed) {
  std::vector<FrontState> states, without; // without: places where neither way fits
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const FrontFrame& frame = frames[f];
    FrontState state;
    state.frame = frame;
    state.toughness = toughness(frame.point);
    if (!(state.toughness > 0))
      throw InputError(fmt::format("tearing: the toughness at ({:.6g}, {:.6g}, {:.6g}) m is {} J/m2; it must be "
                                   "positive",
                                   frame.point.x(), frame.point.y(), frame.point.z(), state.toughness));
    if (presses_behind(problem, frame, closed)) {
      try {
        state.intensities = probe.by_jump(frame);
        state.by_integral = false;
        states.push_back(state);
      } catch (const InputError&) {
        without.push_back(state);
      }
    } else {
      const std::optional<Intensities> found = probe.by_integral(f, frame);
      state.intensities = found.value_or(state.intensities);
      (found ? states : without).push_back(state);
    }
  }
  const std::size_t known = states.size();
  for (FrontState& state : without) {
    // Bending and other loads from beyond a few spacings spoil the correlation more than a short way along the front.
    double distance = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < known; ++k)
      if (const double d = (states[k].frame.point - state.frame.point).norm(); d < distance) {
        distance = d;
        state.intensities = states[k].intensities;
      }
    state.by_integral = distance <= 3 * spacing_at(problem.nodes, state.frame.point);
    if (!state.by_integral) {
      try {
        state.intensities = probe.by_jump(state.frame);
      } catch (const InputError&) { // too near to the surface even for this: the nearest place it is
        if (known == 0)
          throw NumericalError(fmt::format("tearing: the intensities cannot be had at ({:.6g}, {:.6g}, {:.6g}) m: the "
                                           "front, {:.3g} m long, is too near to the surface for the node spacing",
                                           state.frame.point.x(), state.frame.point.y(), state.frame.point.z(),
                                           problem.incision->front_length()));
      }
    }
    states.push_back(state);
  }
  for (FrontState& state : states) {
    state.release = driving_release_rate(problem.material, state.intensities);
    state.angle = kink_angle(state.intensities);
  }
  return states;
}

std::vector<FrontState> averaged(const Material& material, const std::vector<FrontState>& states, double length) {
  std::vector<FrontState> result = states;
  for (FrontState& state : result) {
    Intensities sum = Intensities::Zero();
    double weights = 0;
    for (const FrontState& other : states) {
      if (other.frame.normal.dot(state.frame.normal) < 0.5)
        continue; // of another front
      const double weight = std::exp(-0.5 * (other.frame.point - state.frame.point).squaredNorm() / (length * length));
      sum += weight * at_kink(other.intensities, -angle_across(state.frame, other.frame.ahead));
      weights += weight;
    }
    state.intensities = sum / weights;
    state.release = driving_release_rate(material, state.intensities);
    state.angle = kink_angle(state.intensities);
  }
  return result;
}

double onset_share(const Material& material, const std::vector<FrontState>& unloaded,
                   const std::vector<FrontState>& loaded, double drive) {
  if (unloaded.size() != loaded.size())
    throw InputError(fmt::format("tearing: {} places of the front without load, {} with it; the same are wanted",
                                 unloaded.size(), loaded.size()));
  std::vector<Intensities> start; // where faces press on one another places may come in another order
  for (std::size_t k = 0; k < loaded.size(); ++k) {
    const Vector3& x = loaded[k].frame.point;
    const FrontState* same = &unloaded[k];
    for (const FrontState& other : unloaded)
      if ((other.frame.point - x).squaredNorm() < (same->frame.point - x).squaredNorm())
        same = &other;
    start.push_back(same->intensities);
  }
  const auto reached = [&](double share) {
    for (std::size_t k = 0; k < loaded.size(); ++k) {
      const Intensities& from = start[k];
      if (driving_release_rate(material, from + share * (loaded[k].intensities - from)) >= drive * loaded[k].toughness)
        return true;
    }
    return false;
  };
  constexpr int parts = 32, halvings = 40; // G is not monotonous where the load turns
  if (reached(0))
    return 0;
  for (int part = 1; part <= parts; ++part) {
    double low = (part - 1.0) / parts, high = static_cast<double>(part) / parts;
    if (!reached(high))
      continue;
    for (int k = 0; k < halvings; ++k)
      (reached(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
    return high;
  }
  return 1;
}

std::vector<FrontState> directed(std::vector<FrontState> states, TearDirection rule,
                                 const std::function<double(const Vector3&)>& toughness, double probe) {
  if (!(probe > 0) || !std::isfinite(probe))
    throw InputError(fmt::format("tearing: the toughness is looked at {} m ahead; that must be positive", probe));
  constexpr int samples = 160;
  constexpr double widest = 80 * std::numbers::pi / 180;
  for (FrontState& state : states) {
    const auto met = [&](double angle) {
      return toughness(state.frame.point +
                       probe * (std::cos(angle) * state.frame.ahead + std::sin(angle) * state.frame.normal));
    };
    const double one = std::max(0.0, state.intensities[0]), two = state.intensities[1];
    const auto drive = [&](double angle) {
      const double half = std::cos(angle / 2);
      const double opening = half * (one * half * half - 1.5 * two * std::sin(angle));
      return opening > 0 ? opening * opening / met(angle) : 0;
    };
    double best = kink_angle(state.intensities), most = drive(best);
    if (rule == TearDirection::weakest)
      for (int k = 0; k <= samples; ++k)
        if (const double angle = widest * (2.0 * k / samples - 1), there = drive(angle); there > most * (1 + 1e-6)) {
          best = angle;
          most = there;
        }
    state.angle = best;
    state.toughness = met(best);
    if (!(state.toughness > 0))
      throw InputError(fmt::format("tearing: the toughness near ({:.6g}, {:.6g}, {:.6g}) m is {} J/m2; it must be "
                                   "positive",
                                   state.frame.point.x(), state.frame.point.y(), state.frame.point.z(),
                                   state.toughness));
  }
  return states;
}

std::function<Vector3(const FrontFrame&)> tear_motion(std::vector<FrontState> states, double longest, double smoothing,
                                                      double slope) {
  if (states.empty() || !(longest > 0) || !(smoothing > 0) || !(slope > 0))
    throw InputError(fmt::format("tearing: {} places of the front, steps of {} m, smoothing over {} m, a slope of {} "
                                 "m; all must be positive",
                                 states.size(), longest, smoothing, slope));
  double most = 0; // G / G_c - 1
  for (const FrontState& state : states)
    most = std::max(most, state.release / state.toughness - 1);
  std::vector<double> lengths;
  lengths.reserve(states.size());
  for (const FrontState& state : states) {
    const double excess = state.release / state.toughness - 1;
    const double behind = most > 0 ? std::min(longest * (1 - excess / most), slope * (most - excess)) : 0;
    lengths.push_back(excess < 0 ? 0 : std::max(0.1 * longest, longest - behind));
  }
  return [states = std::move(states), lengths = std::move(lengths), smoothing](const FrontFrame& frame) -> Vector3 {
    double weights = 0, length = 0, nearest = std::numeric_limits<double>::infinity();
    Vector3 direction = Vector3::Zero();
    for (const FrontState& state : states)
      nearest = std::min(nearest, (state.frame.point - frame.point).squaredNorm());
    for (std::size_t k = 0; k < states.size(); ++k) {
      // Places of another front that happens to run close by do not count: theirs is another plane.
      if (states[k].frame.normal.dot(frame.normal) < 0.5)
        continue;
      const double squared = (states[k].frame.point - frame.point).squaredNorm() - nearest;
      const double weight = std::exp(-0.5 * squared / (smoothing * smoothing));
      weights += weight;
      length += weight * lengths[k];
      const FrontFrame& at = states[k].frame;
      direction += weight * (std::cos(states[k].angle) * at.ahead + std::sin(states[k].angle) * at.normal);
    }
    if (!(weights > 0))
      return Vector3::Zero();
    length /= weights;
    const double angle = angle_across(frame, direction);
    return length * (std::cos(angle) * frame.ahead + std::sin(angle) * frame.normal);
  };
}

} // namespace spherecut::solvers
