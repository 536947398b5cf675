#include "experiments/cut_fuzz/solved.hpp"

#include "src/session/session.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"
#include "topology/files/surface_io.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::experiments {

namespace {

/// Words that are alike for refusals of one kind: without numbers and names of files.
std::string reason_of(const std::string& message) {
  std::string reason;
  for (const char c : message.substr(std::min(message.size(), message.rfind(".toml:") + 6))) {
    const bool is_digit = (c >= '0' && c <= '9') || c == '.';
    if (!is_digit)
      reason += c;
    else if (reason.empty() || reason.back() != '#')
      reason += '#';
  }
  return reason.substr(0, 90);
}

/// Soft enough to sag, by a thousandth of its size or so; held below, so that pieces cut off above lie free.
std::string scenario_of(const FuzzOrgan& organ, const std::string& precuts) {
  const BoundingBox bounds = organ.domain->bounds();
  return fmt::format(
      "[organ]\nshape = \"file\"\nfile = \"organ.obj\"\npieces = \"all\"\ncavities = \"keep\"\n[material]\n"
      "young_modulus = 5000\npoisson_ratio = 0.4\ndensity = 1000\n[gravity]\nacceleration = [2, 0, -9]\n"
      "[nodes]\ncoarse_spacing = {}\n[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, {}]\n"
      "normal = [0, 0, 1]\n[output]\nfigures = false\n{}",
      organ.name.find("walls") != std::string::npos ? 0.005 : 0.01, bounds.lower.z() + 0.02 * bounds.extent().z(),
      precuts);
}

} // namespace

SolvedOutcome solve_cuts(const FuzzOrgan& organ, int first, int count, const std::filesystem::path& folder) {
  const double size = organ.domain->bounds().extent().norm();
  std::filesystem::create_directories(folder);
  topology::write_surface(folder / "organ.obj", organ.surface);
  SolvedOutcome outcome;
  for (int blade = first; blade < first + count; ++blade) {
    const FuzzCut cut = make_fuzz_cut(organ, blade);
    ++outcome.blades;
    const auto fail = [&](const std::string& what) {
      outcome.failures.push_back(fmt::format("{}, blade {} ({}): {}", organ.name, blade, cut.kind, what));
    };
    const auto refuse = [&](const std::string& what) {
      ++outcome.refused;
      ++outcome.reasons[reason_of(what)];
      if (what.size() < 20)
        fail("refused without a reason: '" + what + "'");
    };
    try {
      std::string precuts;
      for (const topology::SurfaceMesh& sheet :
           cut.stages.empty() ? std::vector<topology::SurfaceMesh>{} : cut.stages.back()) {
        const std::string name = fmt::format("sheet{}.obj", std::count(precuts.begin(), precuts.end(), '['));
        topology::write_surface(folder / name, sheet);
        precuts += fmt::format("[[precut]]\nshape = \"file\"\nfile = \"{}\"\n", name);
      }
      app::Session session(app::read_scenario_text(folder / "cut.toml", scenario_of(organ, precuts)),
                           [](const std::string&) {});
      for (const app::StepSample& sample : session.steps())
        session.step(sample);
      ++outcome.solved;
      outcome.warned += session.warnings().empty() ? 0 : 1;
      double largest = 0;
      for (const solvers::PointState& state : session.node_states())
        largest = std::max(largest, state.displacement.allFinite() ? state.displacement.norm() / size
                                                                   : std::numeric_limits<double>::infinity());
      outcome.beyond += largest > 1 ? 1 : 0;
      const auto tells = [](const std::string& said) { return said.find("the organ's size") != std::string::npos; };
      if (std::any_of(session.warnings().begin(), session.warnings().end(), tells))
        continue;
      outcome.largest = std::max(outcome.largest, largest);
      if (largest > 1)
        fail(fmt::format("moves by {:.3g} times the organ's size, and it is not said", largest));
    } catch (const InputError& error) {
      refuse(error.what());
    } catch (const NumericalError& error) {
      refuse(error.what());
    } catch (const Interrupted&) {
      throw;
    } catch (const std::exception& error) {
      fail(std::string("threw: ") + error.what());
    }
  }
  return outcome;
}

void add(SolvedOutcome& total, const SolvedOutcome& more) {
  total.blades += more.blades;
  total.solved += more.solved;
  total.refused += more.refused;
  total.warned += more.warned;
  total.beyond += more.beyond;
  total.largest = std::max(total.largest, more.largest);
  for (const auto& [reason, count] : more.reasons)
    total.reasons[reason] += count;
  total.failures.insert(total.failures.end(), more.failures.begin(), more.failures.end());
}

} // namespace spherecut::experiments
