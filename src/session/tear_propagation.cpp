#include "src/session/tear_propagation.hpp"

#include "src/base/stage_timer.hpp"
#include "src/model/finite_model.hpp"
#include "src/tissue/cut_checks.hpp"
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
constexpr double smoothing = 1;   // length along the front over which motions are averaged
constexpr double slope = 2;       // by which they differ for each unit of G / G_c, at most
constexpr double bridge = 4;      // a front shorter than this, too near to the surface for intensities, gives way
constexpr double bridge_step = 3; // by this in one increment
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

/// What the tool of a solved body feels and takes.
struct ToolLoad {
  Vector3 force;       // N, of the body on the tool
  double friction = 0; // J, taken by friction in the last step
  bool acts = false;
};
ToolLoad tool_load(const BodyModel& model) {
  if (model.finite != nullptr) {
    const FiniteStep& step = model.finite->last();
    return {step.force, step.friction_work, step.active_nodes > 0};
  }
  const solvers::ContactState& tool = model.state->tool;
  return {tool.tool_force, tool.friction_work, tool.active_nodes > 0};
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
  if (model.finite != nullptr)
    return {model.finite->last().loads, model.finite->last().energy};
  const double loads = model.body->load_work(model.field);
  const solvers::ContactState& tool = model.state->tool;
  double pressed = 0; // forces of the tool times displacement
  for (std::size_t c = 0; c < tool.nodal_forces.size(); ++c)
    pressed += tool.nodal_forces[c].dot(tool.displacement.segment<3>(3 * static_cast<Eigen::Index>(c)));
  return {loads, 0.5 * (loads + pressed)};
}

TearPropagation::TearPropagation(SessionState& state, Grasping& grasping, ContactSolver& contact,
                                 BackgroundBodies& background, BodyUpdater& updater, const TearFronts& fronts,
                                 ResistedBlade* blade)
    : state_(state), grasping_(grasping), contact_(contact), background_(background), updater_(updater),
      fronts_(fronts), blade_(blade) {}

// What the step has done so far. A blade's cut takes of what the loads release what its surface needs; the rest of
// that, and what a grasper does that lets go, belongs to nobody.
void TearPropagation::book_loading(const StepSample& sample, const Loading& loading) {
  const Energies now = energies(state_.model);
  const ToolLoad tool = tool_load(state_.model);
  if (!account_) {
    account_ = TearAccount{};
  } else {
    EnergyLedger& ledger = account_->ledger;
    double work = 0;
    if (sample.tool && account_->pose)
      work = -0.5 * (account_->force + tool.force).dot(sample.tool->point - account_->pose->point);
    const double loads = now.loads - account_->last.loads, elastic = now.elastic - account_->last.elastic;
    ledger.tool += work;
    ledger.loads += loads;
    ledger.elastic += elastic;
    ledger.dissipation += tool.friction;
    const double released = std::max(0.0, work + loads - elastic - tool.friction);
    if (loading.cut_surface > 0)
      ledger.surface += std::min(released, loading.cut_surface);
    if (loading.releases || loading.cut_surface > 0)
      ledger.dissipation += std::max(0.0, released - loading.cut_surface);
  }
  account_->last = now;
  account_->force = tool.force;
  account_->pose = sample.tool;
  account_->time = sample.time;
}

// Whether the tool has brought the load of this step since the last account, so that the load at which a front moves
// can be looked for. A loop in real time wants the force where the tool is. At finite strain a tool that rubs or bonds
// cannot go back on its way.
bool TearPropagation::follows_load(const StepSample& sample, const Loading& loading) const {
  const bool may_go_back = grasping_.holds() || state_.model.finite == nullptr ||
                           state_.scenario.contact.condition == solvers::ContactCondition::frictionless;
  return !state_.options.tear_gradually && !loading.releases && loading.cut_surface == 0 && account_ &&
         account_->pose && sample.tool && may_go_back && (grasping_.holds() || tool_load(state_.model).acts) &&
         sample.tool->point != account_->pose->point;
}

// Cuts as `grow` does and solves the body with it; where that cannot be, all is as before and the report says why.
bool TearPropagation::take(const StepSample& sample, const std::function<void()>& grow, TearReport& report,
                           BodyUpdate& update) {
  const auto refuse = [&](const char* why) {
    report.reason = fmt::format("refused: {}", why);
    state_.log.warn("tear refused", fmt::format("a tear was refused at t = {:g} s: {}", sample.time, why));
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
  FineZoneTracker::Mark zone = state_.zone.mark();
  std::optional<Grasp> lost;
  try {
    build(sample, lost, update);
    return true;
  } catch (const InputError& error) {
    refuse(error.what());
  } catch (const NumericalError& error) {
    refuse(error.what());
  }
  state_.zone.go_back(std::move(zone));
  if (lost)
    grasping_.take_back(std::move(*lost));
  state_.incisions->take_back();
  return false;
}

// The body with what has been torn, solved. `lost`: what a grasper held, should that have come off.
void TearPropagation::build(const StepSample& sample, std::optional<Grasp>& lost, BodyUpdate& update) {
  BodyModel next = updater_.next();
  if (!grasping_.holds())
    require_clear_of_tool(*next.incision, state_.model, state_.scenario.contact.condition);
  state_.check_pieces(sample.time);
  {
    const StageTimer timer(update.seconds.level_sets);
    state_.incisions->update_fields();
  }
  std::string renewed = updater_.lead_zone(*next.incision);
  if (grasping_.holds() && grasping_.piece_is_free(state_.incisions->wound())) {
    lost = grasping_.lose();
    renewed = "the piece in the grasper has come off";
    state_.log.warn("grip", fmt::format("t = {:g} s: the piece in the grasper has come off", sample.time));
  }
  background_.drop_following();
  updater_.build_cut(renewed, next, update);
  {
    const StageTimer timer(update.seconds.solve);
    contact_.solve(sample, next);
  }
  state_.profile.topology += update.seconds.topology;
  state_.profile.level_sets += update.seconds.level_sets;
  state_.model = std::move(next);
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
  const auto motion = solvers::tear_motion(moving, longest, smoothing * fine, slope * fine);
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

// The increments of one step's tear. `states_` is what the fronts feel with the tool at `share_` of its way in the
// step.
class TearPropagation::Loop {
 public:
  Loop(TearPropagation& tears, const StepSample& sample, const Loading& loading, StepResult& result)
      : tears_(tears), state_(tears.state_), sample_(sample), loading_(loading), result_(result),
        report_(result.tear.emplace()), fine_(state_.zone.fine()), stride_(state_.scenario.tearing.step * fine_),
        pieces_(state_.wound()->pieces.size()), proposed_(tears.blade_ != nullptr && tears.blade_->has_proposal()) {}

  void run() {
    begin();
    add_row();
    start_ = states_ ? drive_of(*states_) : 0;
    if (goes_on_) {
      start_ = account().start;
      kept_ = account().kept;
    } else {
      account().told = false;
    }
    for (int number = 1; increment(number); ++number)
      ;
    end();
  }

 private:
  using States = std::optional<std::vector<solvers::FrontState>>;
  /// What an increment adds to the cut, and why.
  struct Growth {
    topology::FrontGrowth sheets;
    std::optional<topology::SurfaceMesh> seed; // a new cut
    bool gives_way = false;                    // what is left between the front and the surface
    bool joins = false;                        // two fronts
    double longest = 0;                        // m, way of the front
    std::vector<solvers::FrontState> moving;
  };

  [[nodiscard]] TearAccount& account() { return *tears_.account_; }
  void find_states() {
    const StageTimer timer(intensity_seconds_);
    states_ = tears_.fronts_.known_states(state_.model);
  }
  [[nodiscard]] StepSample loaded_sample() const { return loaded(from_, since_, sample_, share_); }

  // Of the front in the next increment, m, as far as it is known how G falls.
  [[nodiscard]] double way_of(double drive) {
    if (account().decay > 0)
      return stride_ * std::clamp(std::log(std::max(drive, 1.0)) / (account().decay * stride_), least_step, 1.0);
    return drive < 1.1 ? first_step * stride_ : stride_;
  }

  void load_to(double to) {
    share_ = to;
    const StepSample part = loaded_sample();
    tears_.contact_.solve(part, state_.model);
    tears_.book_loading(part, share_ < 1 ? Loading{} : loading_);
    find_states();
  }

  // On to where the largest G / G_c is `target`, if it comes to that in this step, else to its end. `full`: the states
  // at its end; the solution is at either. Intensities go in proportion to the load, at finite strain nearly so: there
  // the place is looked for between a load below it and one above.
  void load_until(double target, const States& full) {
    constexpr int most_trials = 6;
    constexpr double near = 0.01, margin = 0.05; // of the target; of what is left to look in, from its ends
    States low = states_, high = full;
    double from = share_, to = 1;
    for (int trial = 1;; ++trial) {
      const bool compare = low && high && low->size() == high->size();
      double part =
          compare ? solvers::onset_share(state_.scenario.material, *low, *high, target) : (trial == 1 ? 1.0 : 0.5);
      if (trial > 1)
        part = std::clamp(part, margin, 1 - margin);
      const double share = from + (to - from) * part;
      if (state_.model.finite == nullptr || part == 0 || share >= 1 || trial == most_trials) {
        load_to(share);
        return;
      }
      try {
        tears_.contact_.solve(loaded(from_, since_, sample_, share), state_.model);
      } catch (const NumericalError&) { // no equilibrium there; there is one below
        to = share;
        high.reset();
        continue;
      }
      find_states();
      const double drive = states_ ? drive_of(*states_) : 0;
      if (std::abs(drive / target - 1) < near) {
        share_ = share;
        tears_.book_loading(loaded_sample(), Loading{});
        return;
      }
      (drive < target ? from : to) = share;
      (drive < target ? low : high) = states_;
    }
  }

  void begin() {
    find_states();
    // A tear that makes one increment a step goes on in the next where nothing has changed but the tear.
    const std::optional<TearAccount>& tears = tears_.account_;
    goes_on_ =
        state_.options.tear_gradually && tears && tears->grows && !loading_.releases && loading_.cut_surface == 0 &&
        sample_.tool.has_value() == tears->pose.has_value() &&
        (!sample_.tool || (sample_.tool->point == tears->pose->point && sample_.tool->axis == tears->pose->axis));
    // The tool's way in this step, and how much of it the body has been loaded by.
    const bool follows =
        states_ && !states_->empty() && drive_of(*states_) >= in_balance && tears_.follows_load(sample_, loading_);
    if (!follows) {
      tears_.book_loading(sample_, loading_);
      return;
    }
    from_ = *tears->pose;
    since_ = tears->time;
    share_ = 0;
    const States full = states_;
    try {
      tears_.contact_.solve(loaded_sample(), state_.model);
      find_states();
      load_until(1, full);
    } catch (const NumericalError&) { // no way back at finite strain: it tears where the step ends
      load_to(1);
    }
  }

  void add_row() {
    report_.increments.push_back(
        increment_of(states_.value_or(std::vector<solvers::FrontState>{}), state_.model.incision.get()));
    TearIncrement& row = report_.increments.back();
    row.time = loaded_sample().time;
    row.force = tool_load(state_.model).force.norm();
    row.ledger = account().ledger;
    row.body.nodes = state_.model.sprinkling.nodes.size();
    row.intensity_seconds = intensity_seconds_;
    state_.profile.intensities += std::exchange(intensity_seconds_, 0);
  }

  // The tool goes on where what moves is no more in balance. Returns the largest G / G_c at the end of the step.
  double follow_load() {
    double drive = states_ ? drive_of(*states_) : 0, ahead = drive;
    // G falls by exp(-decay way) in the increment: half of that before, half after what moves is in balance.
    const double moving_drive = states_ ? moving_drive_of(*states_, way_of(drive), fine_) : 0;
    if (share_ < 1 && moving_drive < std::max(in_balance, std::exp(0.5 * account().decay * way_of(drive)))) {
      const States now = states_;
      tears_.contact_.solve(sample_, state_.model);
      find_states();
      const States full = states_;
      ahead = full ? drive_of(*full) : 0;
      states_ = now;
      const double above = moving_drive > 0 ? drive / moving_drive : 1;
      if (ahead < in_balance)
        load_to(1);
      else
        load_until(std::max(drive, above * std::exp(0.5 * account().decay * way_of(ahead))), full);
      drive = states_ ? drive_of(*states_) : 0;
      ahead = std::max(ahead, drive);
      start_ = drive;
      kept_ = 0;
    }
    return ahead;
  }

  // Empty: the tear ends here, and the report says why.
  std::optional<Growth> next_growth(int number, double ahead) {
    const TearSettings& settings = state_.scenario.tearing;
    const double drive = states_ ? drive_of(*states_) : 0;
    const bool moves = drive >= in_balance || (share_ < 1 && states_ && !states_->empty());
    Growth growth;
    growth.gives_way = !states_ && state_.model.incision->front_length() < bridge * fine_;
    if (!growth.gives_way && !moves && !(growth.seed = tears_.fronts_.seed(state_.model))) {
      report_.reason = !states_           ? "the front is too near to the surface for its intensities"
                       : states_->empty() ? "there is no front"
                                          : "less is released than a tear takes";
      return std::nullopt;
    }
    if (number > (state_.options.tear_gradually ? 1 : settings.most_increments)) {
      report_.reason = "as many increments as are allowed in one step";
      return std::nullopt;
    }
    if (settings.most_area > 0 && account().area >= settings.most_area) {
      report_.reason = "as much is torn as is allowed";
      state_.log.warn("torn", fmt::format("t = {:g} s: {:.3g} m2 are torn, as many as tearing.most_area allows",
                                          sample_.time, account().area));
      return std::nullopt;
    }
    if (tears_.blade_ != nullptr)
      tears_.blade_->drop_proposal();
    growth.longest = growth.gives_way ? bridge_step * fine_ : way_of(ahead);
    if (!growth.gives_way && !growth.seed)
      growth.moving = share_ < 1 ? acting(*states_, drive) : *states_;
    lay_sheets(growth);
    if (growth.sheets.triangles == 0) {
      report_.reason = "the fronts have met other cuts";
      return std::nullopt;
    }
    return growth;
  }

  void lay_sheets(Growth& growth) {
    if (growth.seed) {
      if (state_.model.incision != nullptr)
        growth.sheets.sheets = state_.model.incision->sheets();
      growth.sheets.sheets.push_back(*growth.seed);
      growth.sheets.triangles = static_cast<int>(growth.seed->triangles.size());
      return;
    }
    if (!growth.gives_way)
      growth.sheets = tears_.fronts_.join(state_.model, growth.moving);
    growth.joins = growth.sheets.triangles > 0;
    if (!growth.joins)
      growth.sheets = tears_.fronts_.grow(state_.model, growth.moving, growth.longest);
  }

  // False: the tear has come to its end.
  bool increment(int number) {
    interruption_point();
    const std::optional<Growth> growth = next_growth(number, follow_load());
    if (!growth)
      return false;
    watch_layer(growth->moving);
    const auto before = state_.model.incision;
    const double area_before = before == nullptr ? 0 : before->area();
    const double toughness = before == nullptr
                                 ? state_.toughness(growth->seed->vertices.front())
                                 : mean_toughness(growth->sheets, *before, *state_.organ.domain, state_.toughness);
    const auto grow = [&] {
      growth->seed ? state_.incisions->seed(*growth->seed) : state_.incisions->tear(growth->sheets.sheets);
    };
    BodyUpdate update;
    if (!tears_.take(loaded_sample(), grow, report_, update))
      return false;
    report_.seeded = report_.seeded || growth->seed.has_value();
    book(*growth, state_.model.incision->area() - area_before, toughness);
    add_row();
    TearIncrement& row = report_.increments.back();
    row.number = number;
    row.triangles = growth->sheets.triangles;
    row.advance = growth->seed || growth->joins ? 0 : growth->longest;
    row.body = std::move(update);
    tell();
    return true;
  }

  // Energies of the increment that has been taken, `torn` m2 of it.
  void book(const Growth& growth, double torn, double toughness) {
    const States was_states = states_;
    find_states();
    const Energies now = energies(state_.model);
    const double free = account().last.potential() - now.potential(), surface = toughness * torn;
    double surplus = free - surface; // of a front that is gone, or comes about, by the energies alone
    double slipped = 0;              // J, taken by the tool as it rubs on what has moved
    if (!growth.seed && !growth.gives_way && !growth.joins && states_ && !states_->empty()) {
      const std::vector<double> advance = advances(*was_states, growth.moving, growth.longest, fine_);
      const Swept was = swept(*was_states, *was_states, advance), is = swept(*states_, *was_states, advance);
      surplus = 0.5 * (was.surplus + is.surplus) * torn;
      slipped = tool_load(state_.model).friction;
      if (growth.longest >= told * stride_) {
        account().decay = std::max(0.0, std::log(was.drive / std::max(is.drive, 1e-3)) / growth.longest);
        kept_ += drive_of(*states_) >= kept_drive * start_ ? 1 : 0;
      }
    }
    EnergyLedger& ledger = account().ledger;
    ledger.loads += now.loads - account().last.loads;
    ledger.elastic += now.elastic - account().last.elastic;
    ledger.surface += surface;
    ledger.dissipation += std::max(0.0, surplus) + slipped;
    account().last = now;
    account().force = tool_load(state_.model).force;
    account().area += torn;
    result_.cut->triangles += growth.sheets.triangles;
  }

  // Under a layer of few nodes the near field of a front has no room.
  void watch_layer(const std::vector<solvers::FrontState>& moving) {
    constexpr double least = 2; // fine spacings: G is within 10 % from there on, 45 % too small at 1.3
    if (state_.model.incision == nullptr)
      return;
    if (const auto thin = tears_.fronts_.thin_layer(state_.model, moving, least))
      state_.log.warn(
          "layer", fmt::format("t = {:.3g} s: at [{:.4g}, {:.4g}, {:.4g}] m the tear runs {:.2g} mm below the surface, "
                               "{:.2g} spacings: below {:g} its release rate may be half of what it is; "
                               "nodes.fine_spacing = {:.2g} would do",
                               loaded_sample().time, thin->place.x(), thin->place.y(), thin->place.z(),
                               1e3 * thin->thickness, thin->thickness / fine_, least, thin->thickness / least));
  }

  void tell() {
    if (kept_ >= kept_to_tell && !report_.unstable) {
      report_.unstable = true;
      if (!std::exchange(account().told, true))
        state_.log.say(fmt::format("t = {:g} s: the tear is unstable, it runs on by itself", sample_.time));
    }
    if (state_.incisions->wound().pieces.size() > pieces_)
      report_.severed = true;
  }

  void end() {
    if (share_ < 1)
      load_to(1);
    account().grows = report_.increments.size() > 1;
    account().start = start_;
    account().kept = kept_;
    if (tears_.blade_ != nullptr && (report_.increments.size() > 1 || (proposed_ && !tears_.blade_->has_proposal())))
      tears_.blade_->meet_again();
    report_.area = account().area;
    report_.ledger = account().ledger;
    if (report_.severed)
      state_.log.say(fmt::format("t = {:g} s: the tear has parted the organ", sample_.time));
  }

  TearPropagation& tears_;
  SessionState& state_;
  const StepSample& sample_;
  const Loading& loading_;
  StepResult& result_;
  TearReport& report_;
  double fine_, stride_; // m
  std::size_t pieces_;   // of the organ at the start
  bool proposed_;        // a blade's proposal stood then
  double intensity_seconds_ = 0;
  States states_;
  bool goes_on_ = false;
  topology::ToolPose from_; // where the tool was at `since_`, s, if its way is followed
  double since_ = 0, share_ = 1;
  double start_ = 0; // G / G_c when the growth at this load began
  int kept_ = 0;
};

void TearPropagation::tear(const StepSample& sample, const Loading& loading, StepResult& result) {
  Loop(*this, sample, loading, result).run();
}

} // namespace spherecut::app
