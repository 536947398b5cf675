// Fronts of a session's cut: their states, and how its sheets go on from them.
#include "solvers/fracture/tear_seed.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/front_joining.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::app {
namespace {

// In units of the fine spacing:
constexpr double averaged_over = 1.5;  // length along the front over which intensities are averaged
constexpr double motion_smoothing = 1; // and motions
constexpr double motion_slope = 2;     // by which motions differ for each unit of G / G_c, at most
constexpr double probe = 0.5;          // so far ahead the toughness is looked at
constexpr double met_reach = 0.3;      // nearer to another sheet a front has met it
constexpr double overlap = 0.05;       // by which a front runs into the sheet that it meets
constexpr double smallest_seed = 2;    // least radius of a tear that starts without a cut
constexpr double ligament = 2;         // between two fronts: a narrower one is not resolved and gives way
constexpr double joined_reach = 1.5;   // of the ligament: fronts so near to it are those of its sides
constexpr double gap_share = 0.4;      // of the gap between two fronts: farther none of them goes in one increment

/// Whether another sheet passes through the front there, beside the own one on both of its faces.
bool has_met(const topology::Incision& incision, const topology::FrontFrame& frame, double fine) {
  const Vector3 along = met_reach * fine * frame.ahead, off = 0.1 * fine * frame.normal;
  return incision.blocks(frame.point + off - along, frame.point + off + along) &&
         incision.blocks(frame.point - off - along, frame.point - off + along);
}

/// The motion, ended just behind the first sheet in its way; none where the front has met one.
Vector3 up_to_next_sheet(const topology::Incision& incision, const topology::FrontFrame& frame, const Vector3& motion,
                         double fine) {
  const double length = motion.norm();
  if (length < 1e-3 * fine)
    return Vector3::Zero();
  if (has_met(incision, frame, fine))
    return Vector3::Zero();
  const Vector3 way = motion / length;
  const double start = 1e-2 * fine;
  const auto blocked = [&](double at) { return incision.blocks(frame.point + start * way, frame.point + at * way); };
  if (length <= start || !blocked(length + overlap * fine))
    return motion;
  double clear = start, hit = length + overlap * fine;
  for (int halving = 0; halving < 30; ++halving)
    (blocked(0.5 * (clear + hit)) ? hit : clear) = 0.5 * (clear + hit);
  return (hit + overlap * fine) * way;
}

} // namespace

// Along all fronts but where they have met another sheet.
std::vector<solvers::FrontState> Session::front_states() const {
  if (model_.incision == nullptr || model_.incision->front().empty())
    return {};
  const double fine = zone_.spacing.fine;
  std::vector<Vector3> closed;
  if (model_.state)
    for (std::size_t p = 0; p < std::min(model_.pairs.size(), model_.state->lips.closed.size()); ++p)
      if (model_.state->lips.closed[p] != 0)
        closed.push_back(model_.sprinkling.nodes.positions[model_.pairs[p].plus]);
  std::vector<solvers::FrontState> states =
      solvers::front_states(*model_.body, model_.field, toughness_, fine, closed, &model_.front_rules);
  std::erase_if(states, [&](const solvers::FrontState& state) {
    return !state.intensities.allFinite() || has_met(*model_.incision, state.frame, fine);
  });
  return solvers::directed(solvers::averaged(scenario_.material, states, averaged_over * fine),
                           scenario_.tearing.direction, toughness_, probe * fine);
}

topology::FrontGrowth Session::grow_tear(const std::vector<solvers::FrontState>& states, double longest) const {
  const double fine = zone_.spacing.fine;
  const topology::Incision& incision = *model_.incision;
  const auto motion = states.empty()
                          ? std::function<Vector3(const topology::FrontFrame&)>(
                                [&](const topology::FrontFrame& frame) -> Vector3 { return longest * frame.ahead; })
                          : solvers::tear_motion(states, longest, motion_smoothing * fine, motion_slope * fine);
  const auto facing = topology::facing_fronts(incision, longest / gap_share);
  return topology::grow_front(
      incision,
      [&](const topology::FrontFrame& frame) {
        Vector3 step = motion(frame);
        for (const topology::FacingFronts& pair : facing)
          if ((pair.middle - frame.point).norm() < sheet_edge(zone_) && step.norm() > gap_share * pair.across.norm())
            step *= gap_share * pair.across.norm() / step.norm();
        return up_to_next_sheet(incision, frame, step, fine);
      },
      sheet_edge(zone_));
}

// The states along all fronts; empty: they are too near to the surface for intensities all along.
std::optional<std::vector<solvers::FrontState>> Session::known_states() const {
  try {
    return front_states();
  } catch (const NumericalError&) {
    return std::nullopt;
  }
}

// Two fronts that have come so near to each other that the ligament between them is not resolved part it, once one of
// them moves. No triangles: there are no such fronts.
topology::FrontGrowth Session::join_tears(const std::vector<solvers::FrontState>& states) const {
  const double reach = ligament * zone_.spacing.fine;
  const std::vector<topology::FacingFronts> facing = topology::facing_fronts(*model_.incision, reach);
  const bool moves = std::any_of(facing.begin(), facing.end(), [&](const topology::FacingFronts& pair) {
    return std::any_of(states.begin(), states.end(), [&](const solvers::FrontState& state) {
      return state.release >= state.toughness && (state.frame.point - pair.middle).norm() < joined_reach * reach;
    });
  });
  return moves ? topology::join_fronts(*model_.incision, reach) : topology::FrontGrowth{};
}

// A crack across the largest stress, where that reaches the strength off every cut, held region and tool.
std::optional<topology::SurfaceMesh> Session::seed_of_tear() const {
  const TearSettings& settings = scenario_.tearing;
  if (settings.strength == 0)
    return std::nullopt;
  const solvers::NodeCloud& nodes = model_.sprinkling.nodes;
  const auto toughness = toughness_;
  const double length = settings.length > 0
                            ? settings.length
                            : solvers::averaging_length(scenario_.material, scenario_.toughness, settings.strength);
  std::vector<Vector3> held;
  for (const solvers::Prescribed& entry : model_.body->problem().prescribed)
    held.push_back(nodes.positions[entry.node]);
  held.insert(held.end(), model_.patch.rest.begin(), model_.patch.rest.end());
  const solvers::WeakPlace weakest =
      solvers::weakest_place(*model_.body, model_.field, length, settings.strength, [&](int i) {
        const Vector3& x = nodes.positions[i];
        return nodes.kinds[i] != solvers::NodeKind::lip &&
               (model_.incision == nullptr || !model_.incision->closest(x, length)) &&
               std::none_of(held.begin(), held.end(), [&](const Vector3& y) { return (y - x).norm() < length; });
      });
  if (weakest.node < 0)
    return std::nullopt;
  const Vector3& place = nodes.positions[weakest.node];
  const double radius = std::max(solvers::seed_radius(scenario_.material, toughness(place), settings.strength),
                                 smallest_seed * zone_.spacing.fine);
  return topology::make_disc_sheet(place, weakest.stress.direction, radius, std::min(sheet_edge(zone_), radius / 2));
}

} // namespace spherecut::app
