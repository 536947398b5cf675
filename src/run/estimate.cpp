#include "src/run/estimate.hpp"

#include "src/scenario/law_reader.hpp"
#include "src/session/session.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double many_nodes = 10000, long_time = 600; // s

double grown(double at_reference, double nodes, double reference, double power) {
  return at_reference * std::pow(nodes / reference, power);
}

std::string told(double bytes, double one, double all, const std::string& of_steps, int nodes) {
  std::string text = fmt::format("estimate: {:.2g} GB; {:.2g} s of one core to make the body", bytes / 1e9, one);
  if (!of_steps.empty())
    text += fmt::format(", up to {:.2g} s for the {}", all, of_steps);
  if (nodes > many_nodes || all > long_time)
    text +=
        fmt::format("\nthis is heavy: {} nodes; a larger nodes.fine_spacing or nodes.coarse_spacing, or nodes.count, "
                    "make it lighter",
                    nodes);
  return text;
}

/// From what one body takes: measured on blocks of 746, 2597 and 6119 nodes under a ball (99, 317 and 1035 MB; 0.2, 1.8
/// and 8.9 s on one core; collocation at 2597 nodes 358 MB and 2.6 s).
std::string linear(int nodes, long cuts, bool is_balance) {
  constexpr double reference = 2597, program = 40e6;
  const double bytes = program + (is_balance ? 1.15 : 1.0) * grown(277e6, nodes, reference, 1.5);
  const double one = (is_balance ? 1.5 : 1.0) * grown(1.8, nodes, reference, 1.9);
  return told(bytes, one, one * static_cast<double>(1 + cuts),
              cuts > 0 ? fmt::format("{} steps of the blade", cuts) : std::string(), nodes);
}

/// At finite strain every step is solved, and a blade's has a body of its own, beside the one before. Measured on one
/// core, neo-Hookean blocks at nu = 0.45 of 1081, 5534 and 7207 nodes, a ball that goes in by 4 mm in 10 steps: 0.19,
/// 1.4 and 3.0 GB; 0.47, 6.6 and 13.7 s to make the body; 0.08, 1.3 and 3.6 s a step, of 7 to 14 iterations. A blade in
/// 988 and 5368 nodes: 0.35 and 2.4 GB; 0.41 and 5.1 s a step for the body, 0.05 and 0.6 s to solve it. Organ, tables
/// and figures take a second beside: runs of liver_soft, liver and liver_cut took 3.2, 10.8 and 49 s, told as 1.9, 6.1
/// and 35 s.
std::string finite(int nodes, long steps, long cuts, bool has_tool) {
  constexpr double reference = 5534, program = 40e6, beside = 1; // s
  const double bytes = program + (cuts > 0 ? 1.8 : 1.0) * grown(1.6e9, nodes, reference, 1.55);
  const double one = grown(7.5, nodes, reference, 1.77);
  const double step = (has_tool ? 1.0 : 0.5) * grown(1.7, nodes, reference, 2);
  return told(bytes, one, beside + one * static_cast<double>(1 + cuts) + step * static_cast<double>(steps),
              fmt::format("{} step{}", steps, steps == 1 ? "" : "s"), nodes);
}

} // namespace

std::string estimate_text(const Session& session) {
  const Scenario& scenario = session.scenario();
  const int nodes = session.model().sprinkling.nodes.size();
  const long cuts = std::count_if(session.steps().begin(), session.steps().end(),
                                  [](const StepSample& step) { return step.blade.has_value(); });
  return is_nonlinear(scenario.law) ? finite(nodes, std::ssize(session.steps()), cuts, session.touches())
                                    : linear(nodes, cuts, scenario.method.method == solvers::Method::collocation);
}

} // namespace spherecut::app
