#include "src/tissue/state.hpp"

#include "src/base/process_settings.hpp"
#include "src/base/stage_timer.hpp"
#include "src/model/finite_model.hpp"
#include "src/scenario/region_reader.hpp"
#include "src/tissue/cut_checks.hpp"
#include "topology/base/interruption.hpp"

#include <utility>

namespace spherecut::app {
namespace {

Organ timed_organ(const OrganSettings& settings, double& seconds) {
  const StageTimer timer(seconds);
  return make_organ(settings);
}

// What comes before the spacings: may it be run, and what was odd about the organ.
const Scenario& checked(const Scenario& scenario, const Organ& organ, Leader leader, SessionLog& log) {
  interruption_point();
  if (leader == Leader::device)
    require_run(scenario);
  require_regions_apart(scenario, organ.domain);
  use_one_blas_thread();
  for (const std::string& remark : organ.remarks)
    log.warn(remark, remark);
  return scenario;
}

} // namespace

SessionState::SessionState(Scenario scenario_in, std::function<void(const std::string&)> say, Leader led_by)
    : leader(led_by), scenario(std::move(scenario_in)), log(std::move(say)),
      organ(timed_organ(scenario.organ, profile.organ)), query(organ.domain->surface()),
      toughness(toughness_field(scenario)), zone(checked(scenario, organ, leader, log), organ.domain) {}

void SessionState::check_pieces(double time) {
  require_pieces(incisions->wound(), zone.spacing());
  check_held(scenario, incisions->wound(), time, log);
}

std::string SessionState::hindrance() const {
  return hindrance_to_growth(scenario, model, !unheld_pieces(incisions->wound(), scenario.fixed).empty());
}

} // namespace spherecut::app
