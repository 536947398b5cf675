// Problem:   how many times a second can the whole step run, from where the tool is to the force on it, on one core?
//            The paper's 34 nodes; 100, 300 and 1000 nodes, uncut and while a blade cuts at 10 mm/s beside the ball;
//            the body follows the cut in every step, or in the step where the blade has gone 0.3 or 0.5 spacings, or by
//            the clock as real time does it: in the step where the cut appends, else in the background, where the
//            tissue resists the blade too. Half a second, from the first cut on, and two, which are a cut of five
//            spacings. Where the clock leads the blade goes on while a step takes its time.
// Reference: the paper's 100 a second with 34 nodes; the time of one Cholesky factorisation of a dense 900 x 900 matrix
//            on the same machine. For the force where following is put off: that of the body that follows in every
//            step.
// Command:   spherecut experiment run solve_rate --out DIR
#include "experiments/registered.hpp"

#include "experiments/support/haptic_motions.hpp"
#include "experiments/support/stopwatch.hpp"
#include "solvers/published/step.hpp"
#include "solvers/shapes/tool_pattern.hpp"
#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <sched.h>
#include <thread>

extern "C" void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);

namespace spherecut::experiments {
namespace {

using solvers::Method;

/// Seconds of one Cholesky factorisation of a dense 900 x 900 matrix: the best of a hundred.
double yardstick() {
  constexpr int size = 900;
  MatrixX matrix = MatrixX::Constant(size, size, 0.5);
  matrix.diagonal().array() += size;
  double best = 1;
  for (int i = 0; i < 100; ++i) {
    MatrixX factor = matrix;
    int info = 0;
    const Stopwatch watch;
    dpotrf_("L", &size, factor.data(), &size, &info);
    best = std::min(best, watch.seconds());
    if (info != 0)
      throw NumericalError("the yardstick's matrix is not positive definite");
  }
  return best;
}

constexpr std::uint64_t first_tick = 100; // in contact, and the blade on its way
constexpr std::uint64_t step_ticks = 10;  // from one step to the next, ms

struct Rate {
  int nodes = 0;
  double seconds = 0;          // processor time of a step, mean; in the background: s from one to the next
  std::vector<double> steps{}; // s, of each; by the clock from when it was due
  double behind = 0;           // s from where a cut was begun to where its body took over, mean
  int cuts = 0;                // increments among them
  std::map<std::uint64_t, Vector3> forces{}; // N, on the ball, by the tick
};

double longest(const Rate& rate) {
  return rate.steps.empty() ? rate.seconds : *std::max_element(rate.steps.begin(), rate.steps.end());
}

/// Share of the steps that take longer than `limit` s.
double late(const Rate& rate, double limit) {
  const auto count = std::count_if(rate.steps.begin(), rate.steps.end(), [&](double s) { return s > limit; });
  return rate.steps.empty() ? 0 : static_cast<double>(count) / static_cast<double>(rate.steps.size());
}

/// Root mean square of the difference between two runs' forces at the ticks of both, over the peak of the first.
double force_difference(const Rate& every_step, const Rate& other) {
  double peak = 0, sum = 0, count = 0;
  for (const auto& [tick, force] : every_step.forces) {
    peak = std::max(peak, force.norm());
    const auto same = other.forces.find(tick);
    if (same == other.forces.end())
      continue;
    sum += (same->second - force).squaredNorm();
    count += 1;
  }
  if (!(peak > 0) || count == 0)
    throw NumericalError("the ball feels no force");
  return std::sqrt(sum / count) / peak;
}

/// The paper's step: placing the 34 nodes at the contact, supports, rows, condensation, force.
Rate published_rate(int steps) {
  const app::HapticSimulation simulation(haptic_block(haptic_motions().front(), Method::galerkin));
  const topology::Domain& domain = *simulation.session().organ().domain;
  const solvers::ToolPattern pattern = solvers::paper_pattern(0.012);
  std::vector<char> held;
  for (const int shell : pattern.shells)
    held.push_back(shell == *std::max_element(pattern.shells.begin(), pattern.shells.end()) ? 1 : 0);
  solvers::PublishedStep published(pattern.size(), {10'000, 0.3, 1000});
  double sum = 0;
  const Stopwatch watch;
  for (int i = 0; i < steps; ++i) {
    const Vector3 contact(1e-5 * i, 0, 0.030);
    const solvers::NodeCloud nodes = solvers::place(pattern, domain, contact, Vector3::UnitZ());
    sum += published.step(nodes, held, 0, Vector3(0, 0, -0.002)).force.norm();
  }
  const double seconds = watch.seconds() / steps;
  if (!(sum > 0))
    throw NumericalError("the published step gives no force");
  return {pattern.size(), seconds};
}

/// The ball swings on, and the blade cuts on at its speed, until `end` s.
void prolong(double end, HapticMotion& motion, app::Scenario& scenario) {
  constexpr std::size_t swing = 250; // samples of 1 ms
  while (motion.path.back().time < end) {
    app::PathPose pose = motion.path[motion.path.size() - swing];
    pose.time = motion.path.back().time + 0.001;
    motion.path.push_back(pose);
  }
  if (!scenario.blade)
    return;
  std::vector<app::BladePoint>& way = scenario.blade->path;
  const Vector3 speed = (way.back().position - way.front().position) / (way.back().time - way.front().time);
  way.back().position += (end - way.back().time) * speed;
  way.back().time = end;
}

/// The block with ball and blade, and what moves the ball.
struct Motion {
  app::Scenario scenario;
  std::vector<app::PathPose> path;
};

Motion motion_of(Method method, int nodes, bool cut, const std::optional<double>& advance, double toughness,
                 int steps) {
  HapticMotion motion = haptic_motions().front(); // with a cut
  motion.cut = cut;
  app::Scenario scenario = haptic_block(motion, method);
  scenario.nodes.count = nodes;
  if (cut && toughness == 0)
    scenario.blade->advance = advance;
  scenario.toughness = toughness;
  const double end = 1e-3 * static_cast<double>(first_tick + step_ticks * static_cast<std::uint64_t>(steps));
  if (end > motion.duration + 1e-6)
    prolong(end, motion, scenario);
  return {std::move(scenario), std::move(motion.path)};
}

void solve(app::HapticSimulation& simulation, app::ScriptedPath& device, std::uint64_t tick, Rate& rate) {
  app::ContactSnapshot snapshot;
  simulation.solve(device.read(tick), 0, snapshot);
  rate.cuts += snapshot.cut_triangles > 0 ? 1 : 0;
  rate.forces[tick] = snapshot.force;
  rate.nodes = snapshot.nodes;
}

void begin(app::HapticSimulation& simulation, app::ScriptedPath& device) {
  simulation.prepare(device.read(0));
  Rate unused;
  for (std::uint64_t tick = 0; tick < first_tick; tick += step_ticks)
    solve(simulation, device, tick, unused);
}

/// Steps of a session at 100 a second, the ball swinging, from the tenth on.
Rate session_rate(const Motion& motion, int steps) {
  app::HapticSimulation simulation(motion.scenario);
  app::ScriptedPath device(motion.path, 1000);
  begin(simulation, device);
  Rate rate;
  const Stopwatch watch;
  for (int i = 0; i < steps; ++i) {
    const Stopwatch step;
    solve(simulation, device, first_tick + step_ticks * static_cast<std::uint64_t>(i), rate);
    rate.steps.push_back(step.seconds());
  }
  rate.seconds = watch.seconds() / steps;
  return rate;
}

/// This thread, and those that it makes, on one of its cores alone, for as long as this lives.
class OneCore {
 public:
  OneCore() {
    CPU_ZERO(&before_);
    if (sched_getaffinity(0, sizeof before_, &before_) != 0)
      return;
    cpu_set_t one;
    CPU_ZERO(&one);
    for (std::size_t core = CPU_SETSIZE; core-- > 0 && CPU_COUNT(&one) == 0;)
      if (CPU_ISSET(core, &before_))
        CPU_SET(core, &one);
    pinned_ = sched_setaffinity(0, sizeof one, &one) == 0;
  }
  ~OneCore() {
    if (pinned_)
      sched_setaffinity(0, sizeof before_, &before_);
  }
  [[nodiscard]] bool holds() const { return pinned_; }
  OneCore(const OneCore&) = delete;
  OneCore& operator=(const OneCore&) = delete;

 private:
  cpu_set_t before_{};
  bool pinned_ = false;
};

/// The same motion by the clock, on one core: a step is due every `period` ms, at the pose of then, or where one takes
/// longer at the last that is due by then; what is made in the background takes over when it is there.
Rate rate_by_the_clock(const Motion& motion, int steps, std::uint64_t period) {
  using Clock = std::chrono::steady_clock;
  const OneCore core;
  if (!core.holds())
    throw NumericalError("the steps cannot be held to one core");
  app::HapticSimulation simulation(motion.scenario);
  app::ScriptedPath device(motion.path, 1000);
  begin(simulation, device);
  simulation.set_following_in_background(true);
  Rate rate;
  const std::uint64_t end = step_ticks * static_cast<std::uint64_t>(steps);
  const auto start = Clock::now();
  const auto seconds_since = [](Clock::time_point then) {
    return std::chrono::duration<double>(Clock::now() - then).count();
  };
  double began = -1; // ms, when the cut whose body is under way was; -1: none is
  int taken = 0;
  std::uint64_t passed = 0; // ticks that have been
  for (std::uint64_t due = 0; due < end;) {
    for (; passed < due; ++passed)
      simulation.pass(device.read(first_tick + passed));
    passed = due + 1;
    const auto begins = start + std::chrono::milliseconds(due);
    std::this_thread::sleep_until(begins);
    if (simulation.body_is_there())
      simulation.swap_body();
    const int cuts = rate.cuts;
    solve(simulation, device, first_tick + due, rate);
    rate.steps.push_back(seconds_since(begins));
    if (rate.cuts > cuts && began >= 0) {
      rate.behind += 1e-3 * (static_cast<double>(due) - began);
      ++taken;
      began = -1;
    }
    if (simulation.session().pending().under_way && began < 0)
      began = static_cast<double>(due);
    const auto now = static_cast<std::uint64_t>(1e3 * seconds_since(start));
    due = std::max(due + period, now / period * period);
  }
  rate.behind /= std::max(1, taken);
  const double whole = std::max(seconds_since(start), 1e-3 * static_cast<double>(end));
  rate.seconds = whole / static_cast<double>(rate.steps.size());
  return rate;
}

} // namespace

std::vector<Check> run_solve_rate(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table table({"case", "nodes", "cut_increments", "ms", "longest_ms", "late", "per_second", "yardsticks",
                    "behind_ms", "force_difference"});
  const double unit = yardstick();
  context.say(fmt::format("yardstick: {:.2f} ms", 1e3 * unit));
  app::Figure figure;
  figure.title = "Whole steps a second on one core";
  figure.x_label = "nodes";
  figure.y_label = "steps a second";
  figure.log_x = figure.log_y = true;
  const auto report = [&](const std::string& name, const Rate& rate, double asked,
                          std::optional<double> difference = {}) {
    context.say(
        fmt::format("{}: {} nodes, {:.3g} ms (longest {:.3g}, {:.1f} % above {:g}), {:.0f} a second, {:.3g} "
                    "yardsticks, {} cut increments{}{}",
                    name, rate.nodes, 1e3 * rate.seconds, 1e3 * longest(rate), 100 * late(rate, 1 / asked), 1e3 / asked,
                    1 / rate.seconds, rate.seconds / unit, rate.cuts,
                    rate.behind > 0 ? fmt::format(" {:.0f} ms behind", 1e3 * rate.behind) : "",
                    difference ? fmt::format(", force within {:.2g} % of the peak (rms)", 100 * *difference) : ""));
    table.add({name, fmt::format("{}", rate.nodes), fmt::format("{}", rate.cuts),
               fmt::format("{:.4g}", 1e3 * rate.seconds), fmt::format("{:.4g}", 1e3 * longest(rate)),
               fmt::format("{:.4g}", late(rate, 1 / asked)), fmt::format("{:.4g}", 1 / rate.seconds),
               fmt::format("{:.4g}", rate.seconds / unit),
               rate.behind > 0 ? fmt::format("{:.4g}", 1e3 * rate.behind) : "",
               difference ? fmt::format("{:.3g}", *difference) : ""});
  };
  const Rate paper = published_rate(context.quick ? 20 : 2000);
  report("published_34", paper, 100);
  checks.push_back({context.quick ? "published_34_per_second_reported" : "published_34_per_second", 1 / paper.seconds,
                    ">=", context.quick ? 0.0 : 100.0});
  struct Case {
    const char* name;
    bool cut;
    std::optional<double> advance; // fine spacings that the blade goes before the body follows; empty: as real time
    bool goes_on = false, beside = false;
    double toughness = 0; // J/m2, that resists it
  };
  for (const Method method : {Method::galerkin, Method::collocation}) {
    std::map<int, Rate> every_step; // the last ones, by the nodes asked for
    for (const Case& how :
         {Case{"uncut", false, 0}, Case{"cutting", true, 0}, Case{"cutting_put_off", true, 0.3},
          Case{"cutting_put_off_half", true, 0.5}, Case{"cutting_beside", true, std::nullopt, false, true},
          Case{"cutting_on", true, 0, true}, Case{"cutting_on_put_off", true, 0.3, true},
          Case{"cutting_on_put_off_half", true, 0.5, true}, Case{"cutting_on_beside", true, std::nullopt, true, true},
          Case{"cutting_on_resisted", true, std::nullopt, true, true, 5}}) {
      if (context.quick && (how.goes_on || method == Method::collocation))
        continue;
      if (how.goes_on && method == Method::collocation) // minutes
        continue;
      app::Series series{fmt::format("{}, {}", solvers::to_string(method), how.name), {}, {}};
      for (const int nodes : {100, 300, 1000}) {
        if (context.quick && nodes > 100)
          continue;
        const std::string name = fmt::format("{}_{}_{}", solvers::to_string(method), how.name, nodes);
        const int steps = context.quick ? 10 : how.goes_on ? 200 : 50;
        const double asked = nodes == 300 ? 100 : 40;
        const std::uint64_t period = nodes == 300 ? 5 : 10; // ms: twice the rate that is asked for, and more
        const Motion motion = motion_of(method, nodes, how.cut, how.advance, how.toughness, steps);
        const Rate rate = how.beside ? rate_by_the_clock(motion, steps, period) : session_rate(motion, steps);
        const bool is_resisted = how.toughness > 0, is_compared = how.cut && how.advance != 0.0 && !is_resisted;
        const auto difference =
            is_compared ? std::optional(force_difference(every_step.at(nodes), rate)) : std::nullopt;
        report(name, rate, asked, difference);
        if (how.cut && !is_compared && !is_resisted)
          every_step[nodes] = rate;
        series.x.push_back(rate.nodes);
        series.y.push_back(1 / rate.seconds);
        // In the test suite nothing depends on a clock.
        const bool judged = !context.quick && nodes >= 300 && method == Method::galerkin;
        checks.push_back(
            {name + (judged ? "_per_second" : "_per_second_reported"), 1 / rate.seconds, ">=", judged ? asked : 0.0});
        if (how.beside)
          checks.push_back({name + (judged && !is_resisted ? "_late" : "_late_reported"), late(rate, 1 / asked),
                            "<=", judged && !is_resisted ? 0.01 : 1});
        if (how.beside && how.goes_on && judged) // else nothing was followed
          checks.push_back({name + "_cuts", static_cast<double>(rate.cuts), ">=", is_resisted ? 2.0 : 4.0});
        if (difference && !context.quick && nodes >= 300)
          checks.push_back({name + "_force", *difference, "<=", 0.005});
        else if (difference)
          checks.push_back({name + "_force_reported", *difference, "<=", 1.0});
      }
      figure.series.push_back(series);
    }
  }
  table.write(context.out / "solve_rate.csv");
  app::write_png(figure, context.out / "rate.png");
  return checks;
}

} // namespace spherecut::experiments
