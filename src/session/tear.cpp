// The tears of a session: fronts that are given more energy than new cut takes move, increment by increment, until they
// are not, or nothing is left to tear. The tool stands still meanwhile.
#include "src/base/stage_timer.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <stdexcept>
#include <utility>

namespace spherecut::app {
namespace {

// In units of the fine spacing:
constexpr double tear_smoothing = 1; // length along the front over which motions are averaged
constexpr double tear_slope = 2;     // by which they differ for each unit of G / G_c, at most
constexpr double bridge = 4;         // a front shorter than this, too near to the surface for intensities, gives way
constexpr double bridge_step = 3;    // by this in one increment
// Of the longest step:
constexpr double first_step = 0.5, least_step = 0.2; // while the decay of G is not known; where it is
constexpr double told = 0.5;        // increments at least so long tell the decay, and whether growth is unstable
constexpr double kept_drive = 0.95; // share of the G / G_c of its start that a growth keeps
constexpr int kept_to_tell = 2;     // after so many of them: it is
constexpr double in_balance = 1.01; // G / G_c up to which nothing moves: intensities scatter by as much
constexpr double along = 1.1;       // while the load is followed, places so far below the largest G / G_c move with it

double drive_of(const std::vector<solvers::FrontState>& states) {
  double most = 0;
  for (const solvers::FrontState& state : states)
    most = std::max(most, state.release / state.toughness);
  return most;
}

double mean_toughness(const topology::FrontGrowth& growth, const topology::Incision& before,
                      const topology::Domain& domain, const std::function<double(const Vector3&)>& toughness) {
  double area = 0, sum = 0;
  for (std::size_t s = 0; s < growth.sheets.size(); ++s) {
    const topology::SurfaceMesh& sheet = growth.sheets[s];
    const std::size_t had = s < before.sheets().size() ? before.sheets()[s].triangles.size() : 0;
    for (std::size_t t = had; t < sheet.triangles.size(); ++t) {
      const auto& [a, b, c] = sheet.triangles[t];
      const Vector3 &x = sheet.vertices[a], &y = sheet.vertices[b], &z = sheet.vertices[c];
      const Vector3 middle = (x + y + z) / 3;
      if (domain.signed_distance(middle) > 0)
        continue;
      const double part = 0.5 * (y - x).cross(z - x).norm();
      area += part;
      sum += part * toughness(middle);
    }
  }
  return area > 0 ? sum / area : 0;
}

/// Means over what is swept: weighted by how far the nearest of the places `from` moves. Zero without weights.
struct Swept {
  double surplus = 0; // G - G_c, J/m2
  double drive = 0;   // G / G_c
};
Swept swept(const std::vector<solvers::FrontState>& states, const std::vector<solvers::FrontState>& from,
            const std::vector<double>& advance) {
  Swept mean;
  double weights = 0;
  for (const solvers::FrontState& state : states) {
    const auto nearest = std::min_element(from.begin(), from.end(), [&](const auto& a, const auto& b) {
      return (a.frame.point - state.frame.point).squaredNorm() < (b.frame.point - state.frame.point).squaredNorm();
    });
    const double weight = advance[static_cast<std::size_t>(nearest - from.begin())];
    mean.surplus += weight * (state.release - state.toughness);
    mean.drive += weight * state.release / state.toughness;
    weights += weight;
  }
  return weights > 0 ? Swept{mean.surplus / weights, mean.drive / weights} : Swept{};
}

TearIncrement increment_of(const std::vector<solvers::FrontState>& states, const topology::Incision* incision) {
  TearIncrement increment;
  if (incision != nullptr) {
    increment.area = incision->area();
    increment.front_length = incision->front_length();
  }
  double most = -1;
  for (const solvers::FrontState& state : states) {
    increment.front += state.frame.point / static_cast<double>(states.size());
    if (const double drive = state.release / state.toughness; drive > most) {
      most = drive;
      increment.most = state.frame.point;
      increment.intensities = state.intensities;
      increment.release = state.release;
      increment.toughness = state.toughness;
    }
  }
  return increment;
}

} // namespace

Energies energies(const BodyModel& model) {
  Energies energies;
  energies.loads = model.body->load_work(model.field);
  const solvers::ContactState& tool = model.state->tool;
  for (std::size_t c = 0; c < tool.nodal_forces.size(); ++c)
    energies.tool += tool.nodal_forces[c].dot(tool.displacement.segment<3>(3 * static_cast<Eigen::Index>(c)));
  return energies;
}

// What the step has done so far. A blade's cut takes of what the loads release what its surface needs; the rest of
// that, and what a grasper does that lets go, belongs to nobody.
void Session::book_loading(const StepSample& sample, const Loading& loading) {
  const Energies now = energies(model_);
  const Vector3 force = model_.state->tool.tool_force;
  if (!tears_) {
    tears_ = TearAccount{};
  } else {
    EnergyLedger& ledger = tears_->ledger;
    double work = 0;
    if (sample.tool && tears_->pose)
      work = -0.5 * (tears_->force + force).dot(sample.tool->point - tears_->pose->point);
    const double loads = now.loads - tears_->last.loads, elastic = now.elastic() - tears_->last.elastic();
    ledger.tool += work;
    ledger.loads += loads;
    ledger.elastic += elastic;
    const double friction = model_.state->tool.friction_work;
    ledger.dissipation += friction;
    const double released = std::max(0.0, work + loads - elastic - friction);
    if (loading.cut_surface > 0)
      ledger.surface += std::min(released, loading.cut_surface);
    if (loading.releases || loading.cut_surface > 0)
      ledger.dissipation += std::max(0.0, released - loading.cut_surface);
  }
  tears_->last = now;
  tears_->force = force;
  tears_->pose = sample.tool;
  tears_->time = sample.time;
}

// Whether the tool has brought the load of this step since the last account, so that the load at which a front moves
// can be looked for. A loop in real time wants the force where the tool is.
bool Session::follows_load(const StepSample& sample, const Loading& loading) const {
  return !tear_gradually_ && !loading.releases && loading.cut_surface == 0 && tears_ && tears_->pose && sample.tool &&
         (grasps() || model_.state->tool.active_nodes > 0) && sample.tool->point != tears_->pose->point;
}

// Cuts as `grow` does and solves the body with it; where that cannot be, all is as before and the report says why.
bool Session::take_tear(const StepSample& sample, const std::function<void()>& grow, TearReport& report,
                        BodyUpdate& update) {
  const auto refuse = [&](const char* why) {
    report.reason = fmt::format("refused: {}", why);
    warn("tear refused", fmt::format("a tear was refused at t = {:g} s: {}", sample.time, why));
    return false;
  };
  try {
    const StageTimer timer(update.seconds.topology);
    grow();
  } catch (const InputError& error) {
    return refuse(error.what());
  } catch (const NumericalError& error) {
    return refuse(error.what());
  }
  const auto segments = zone_.spacing.segments;
  const auto led = led_segments_;
  const auto grasp = grasp_;
  const solvers::Discretisation* const body = model_.body.get();
  const auto before = model_.incision;
  try {
    BodyModel next;
    next.touched_from = facing();
    next.incision = incisions_->incision();
    CutGrowth growth{.way_ahead = [&] { return way_of_front(before.get(), *next.incision); }};
    if (!grasps())
      require_clear_of_tool(*next.incision, model_, scenario_.contact.condition);
    check_pieces(sample.time);
    {
      const StageTimer timer(update.seconds.level_sets);
      incisions_->update_fields();
    }
    lead_zone(*next.incision, growth);
    if (grasps() && grasped_piece_is_free()) {
      grasp_.reset();
      growth.renewed = "the piece in the grasper has come off";
      warn("grip", fmt::format("t = {:g} s: the piece in the grasper has come off", sample.time));
    }
    drop_following();
    build_cut(growth, next, update);
    {
      const StageTimer timer(update.seconds.solve);
      solve(sample, next);
    }
    profile_.topology += update.seconds.topology;
    profile_.level_sets += update.seconds.level_sets;
    model_ = std::move(next);
    lost_grip_ = lost_grip_ || (grasp && !grasp_);
    return true;
  } catch (const InputError& error) {
    refuse(error.what());
  } catch (const NumericalError& error) {
    refuse(error.what());
  }
  zone_.spacing.segments = segments;
  led_segments_ = led;
  grasp_ = grasp;
  try {
    if (take_back_cut(body))
      solve(sample, model_);
  } catch (const std::runtime_error&) {
    if (blade_force_ != nullptr)
      blade_force_->lift(); // it knows nothing of what has been torn in this step
    throw;
  }
  return false;
}

namespace {

/// The moment at which the tool has gone `share` of its way from `pose` at `time` to that of `sample`.
StepSample loaded(const topology::ToolPose& pose, double time, const StepSample& sample, double share) {
  StepSample part = sample;
  if (share >= 1 || !sample.tool)
    return part;
  part.time = time + share * (sample.time - time);
  part.tool->point = pose.point + share * (sample.tool->point - pose.point);
  part.tool->axis = (pose.axis + share * (sample.tool->axis - pose.axis)).normalized();
  return part;
}

/// Intensities that scatter from place to place would let one place move at a time when the load stops at the first:
/// those within a tenth of it move along.
std::vector<solvers::FrontState> acting(std::vector<solvers::FrontState> states, double drive) {
  for (solvers::FrontState& state : states)
    state.release *= std::max(1.0, along / drive);
  return states;
}

/// How far each of the places moves, m.
std::vector<double> advances(const std::vector<solvers::FrontState>& places,
                             const std::vector<solvers::FrontState>& moving, double longest, double fine) {
  const auto motion = solvers::tear_motion(moving, longest, tear_smoothing * fine, tear_slope * fine);
  std::vector<double> result;
  result.reserve(places.size());
  for (const solvers::FrontState& place : places)
    result.push_back(motion(place.frame).norm());
  return result;
}

/// Mean G / G_c of the next increment's front while the load is followed: what it sweeps has to pay for itself.
double moving_drive_of(const std::vector<solvers::FrontState>& states, double longest, double fine) {
  const double drive = drive_of(states);
  if (!(drive > 0))
    return 0;
  return swept(states, states, advances(states, acting(states, drive), longest, fine)).drive;
}

} // namespace

void Session::tear(const StepSample& sample, const Loading& loading, StepResult& result) {
  TearReport& report = result.tear.emplace();
  const TearSettings& settings = scenario_.tearing;
  const double fine = zone_.spacing.fine, stride = settings.step * fine;
  const int most = tear_gradually_ ? 1 : settings.most_increments;
  const std::size_t pieces = wound()->pieces.size();
  const bool proposed = mark_.has_value();
  using States = std::optional<std::vector<solvers::FrontState>>;
  double intensity_seconds = 0;
  const auto find_states = [&] {
    const StageTimer timer(intensity_seconds);
    return known_states();
  };
  States states = find_states();
  const auto way_of = [&](double drive) { // of the front in the next increment, as far as it is known how G falls
    if (tears_->decay > 0)
      return stride * std::clamp(std::log(std::max(drive, 1.0)) / (tears_->decay * stride), least_step, 1.0);
    return drive < 1.1 ? first_step * stride : stride;
  };
  // A tear that makes one increment a step goes on in the next where nothing has changed but the tear.
  const bool goes_on =
      tear_gradually_ && tears_ && tears_->grows && !loading.releases && loading.cut_surface == 0 &&
      sample.tool.has_value() == tears_->pose.has_value() &&
      (!sample.tool || (sample.tool->point == tears_->pose->point && sample.tool->axis == tears_->pose->axis));
  // The tool's way in this step, and how much of it the body has been loaded by.
  const bool follows = states && !states->empty() && drive_of(*states) >= in_balance && follows_load(sample, loading);
  const topology::ToolPose from = follows ? *tears_->pose : topology::ToolPose{};
  const double since = follows ? tears_->time : 0;
  double share = follows ? 0 : 1;
  const auto load_to = [&](double to) {
    share = to;
    const StepSample part = loaded(from, since, sample, share);
    solve(part, model_);
    book_loading(part, share < 1 ? Loading{} : loading);
    states = find_states();
  };
  // On to where the largest G / G_c is `target`, if it comes to that in this step, else to its end. `states` is at
  // `share`, `full` at its end; the solution is at either.
  const auto load_until = [&](double target, const States& full) {
    const double part = states && full && states->size() == full->size()
                            ? solvers::onset_share(scenario_.material, *states, *full, target)
                            : 1;
    load_to(share + (1 - share) * part);
  };
  if (follows) {
    const States full = states;
    solve(loaded(from, since, sample, 0), model_);
    states = find_states();
    load_until(1, full);
  } else {
    book_loading(sample, loading);
  }
  EnergyLedger& ledger = tears_->ledger;
  const auto add_row = [&] {
    report.increments.push_back(increment_of(states.value_or(std::vector<solvers::FrontState>{}), incision()));
    report.increments.back().time = loaded(from, since, sample, share).time;
    report.increments.back().force = model_.state->tool.tool_force.norm();
    report.increments.back().ledger = ledger;
    report.increments.back().body.nodes = model_.sprinkling.nodes.size();
    report.increments.back().intensity_seconds = intensity_seconds;
    profile_.intensities += std::exchange(intensity_seconds, 0);
  };
  add_row();
  double start = states ? drive_of(*states) : 0;
  int kept = 0;
  if (goes_on) {
    start = tears_->start;
    kept = tears_->kept;
  } else {
    tears_->told = false;
  }
  for (int number = 1;; ++number) {
    interruption_point();
    double drive = states ? drive_of(*states) : 0, ahead = drive; // now, and at the end of the step
    // G falls by exp(-decay way) in the increment: half of that before, half after what moves is in balance.
    const double moving_drive = states ? moving_drive_of(*states, way_of(drive), fine) : 0;
    if (share < 1 && moving_drive < std::max(in_balance, std::exp(0.5 * tears_->decay * way_of(drive)))) {
      const States now = states;
      solve(sample, model_);
      const States full = find_states();
      ahead = full ? drive_of(*full) : 0;
      states = now;
      const double above = moving_drive > 0 ? drive / moving_drive : 1;
      if (ahead < in_balance)
        load_to(1);
      else
        load_until(std::max(drive, above * std::exp(0.5 * tears_->decay * way_of(ahead))), full);
      drive = states ? drive_of(*states) : 0;
      ahead = std::max(ahead, drive);
      start = drive;
      kept = 0;
    }
    const bool moves = drive >= in_balance || (share < 1 && states && !states->empty());
    const bool gives_way = !states && model_.incision->front_length() < bridge * fine;
    std::optional<topology::SurfaceMesh> seed;
    if (!gives_way && !moves && !(seed = seed_of_tear())) {
      report.reason = !states           ? "the front is too near to the surface for its intensities"
                      : states->empty() ? "there is no front"
                                        : "less is released than a tear takes";
      break;
    }
    if (number > most) {
      report.reason = "as many increments as are allowed in one step";
      break;
    }
    if (settings.most_area > 0 && tears_->area >= settings.most_area) {
      report.reason = "as much is torn as is allowed";
      warn("torn", fmt::format("t = {:g} s: {:.3g} m2 are torn, as many as tearing.most_area allows", sample.time,
                               tears_->area));
      break;
    }
    drop_blade_proposal();
    const double longest = gives_way ? bridge_step * fine : way_of(ahead);
    const std::vector<solvers::FrontState> moving = gives_way || seed ? std::vector<solvers::FrontState>{}
                                                    : share < 1       ? acting(*states, drive)
                                                                      : *states;
    topology::FrontGrowth growth;
    bool joins = false;
    if (seed) {
      if (model_.incision != nullptr)
        growth.sheets = model_.incision->sheets();
      growth.sheets.push_back(*seed);
      growth.triangles = static_cast<int>(seed->triangles.size());
    } else {
      if (!gives_way)
        growth = join_tears(moving);
      joins = growth.triangles > 0;
      if (!joins)
        growth = grow_tear(moving, longest);
    }
    if (growth.triangles == 0) {
      report.reason = "the fronts have met other cuts";
      break;
    }
    const auto before = model_.incision;
    const double area_before = before == nullptr ? 0 : before->area();
    const double toughness = before == nullptr ? toughness_(seed->vertices.front())
                                               : mean_toughness(growth, *before, *organ_.domain, toughness_);
    const auto grow = [&] { seed ? incisions_->seed(*seed) : incisions_->tear(growth.sheets); };
    BodyUpdate update;
    if (!take_tear(loaded(from, since, sample, share), grow, report, update))
      break;
    report.seeded = report.seeded || seed.has_value();
    const double torn = model_.incision->area() - area_before;
    const States next = find_states();
    const Energies now = energies(model_);
    const double free = tears_->last.potential() - now.potential(), surface = toughness * torn;
    double surplus = free - surface; // of a front that is gone, or comes about, by the energies alone
    if (!seed && !gives_way && !joins && next && !next->empty()) {
      const std::vector<double> advance = advances(*states, moving, longest, fine);
      const Swept was = swept(*states, *states, advance), is = swept(*next, *states, advance);
      surplus = 0.5 * (was.surplus + is.surplus) * torn;
      const double drive_after = drive_of(*next);
      if (longest >= told * stride) {
        tears_->decay = std::max(0.0, std::log(was.drive / std::max(is.drive, 1e-3)) / longest);
        kept += drive_after >= kept_drive * start ? 1 : 0;
      }
    }
    ledger.loads += now.loads - tears_->last.loads;
    ledger.elastic += now.elastic() - tears_->last.elastic();
    ledger.surface += surface;
    ledger.dissipation += std::max(0.0, surplus);
    tears_->last = now;
    tears_->force = model_.state->tool.tool_force;
    tears_->area += torn;
    result.cut->triangles += growth.triangles;
    states = next;
    add_row();
    TearIncrement& row = report.increments.back();
    row.number = number;
    row.triangles = growth.triangles;
    row.advance = seed || joins ? 0 : longest;
    row.body = std::move(update);
    if (kept >= kept_to_tell && !report.unstable) {
      report.unstable = true;
      if (!std::exchange(tears_->told, true))
        say_(fmt::format("t = {:g} s: the tear is unstable, it runs on by itself", sample.time));
    }
    if (incisions_->wound().pieces.size() > pieces)
      report.severed = true;
  }
  if (share < 1)
    load_to(1);
  tears_->grows = report.increments.size() > 1;
  tears_->start = start;
  tears_->kept = kept;
  if (blade_force_ != nullptr && (report.increments.size() > 1 || (proposed && !mark_)))
    blade_force_->meet_again(model_);
  report.area = tears_->area;
  report.ledger = ledger;
  if (report.severed)
    say_(fmt::format("t = {:g} s: the tear has parted the organ", sample.time));
}

} // namespace spherecut::app
