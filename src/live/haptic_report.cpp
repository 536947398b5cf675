#include "src/live/haptic_report.hpp"

#include "src/base/output_file.hpp"
#include "src/blade/account.hpp"
#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace spherecut::app {
namespace {

constexpr double us = 1e6; // per s

std::string line_of(const Percentiles& p) {
  return fmt::format("p50 {:.1f}, p99 {:.1f}, p99.9 {:.1f}, max {:.1f} us", us * p.p50, us * p.p99, us * p.p999,
                     us * p.largest);
}

nlohmann::json json_of(const Percentiles& p) {
  return {{"p50", p.p50}, {"p99", p.p99}, {"p99.9", p.p999}, {"max", p.largest}};
}

void write_ticks(const std::filesystem::path& file, const LoopRecords& records,
                 const std::vector<SolvedForce>& solved) {
  OutputFile out(file);
  out.write("tick,time_s,x_m,y_m,z_m,force_x_N,force_y_N,force_z_N,tissue_N,solved_N,energy_J,depth_m,sinking_m,"
            "sequence,arrived,active,rounds,converged,limited,outside,latency_us,compute_us,torque_x_Nm,torque_y_Nm,"
            "torque_z_Nm,tissue_Nm\n");
  auto truth = solved.begin();
  std::string text;
  for (const TickRecord& tick : records.ticks) {
    while (truth != solved.end() && truth->tick < tick.device.tick)
      ++truth;
    const bool known = truth != solved.end() && truth->tick == tick.device.tick;
    const Vector3& x = tick.device.position;
    text += fmt::format("{},{:.6g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g},{:.6g},{},{:.6g},{:.6g},{:.3g},{},{:d},{},"
                        "{},{:d},{:d},{:d},{:.1f},{:.1f},{:.6g},{:.6g},{:.6g},{:.6g}\n",
                        tick.device.tick, tick.device.time, x.x(), x.y(), x.z(), tick.force.x(), tick.force.y(),
                        tick.force.z(), tick.tissue.norm(), known ? fmt::format("{:.6g}", truth->force.norm()) : "",
                        tick.energy, tick.depth, tick.sinking, tick.sequence, tick.arrived, tick.active, tick.rounds,
                        tick.converged, tick.limited, tick.outside, us * tick.latency, us * tick.compute,
                        tick.torque.x(), tick.torque.y(), tick.torque.z(), tick.tissue_torque.norm());
    if (text.size() > 1'000'000) {
      out.write(text);
      text.clear();
    }
  }
  out.write(text);
  out.close();
}

void write_second(const std::filesystem::path& file, const std::vector<TickRecord>& ticks) {
  OutputFile out(file);
  std::string text = "tick,time_s,x_m,y_m,z_m,force_x_N,force_y_N,force_z_N,tissue_N,energy_J,limited,torque_x_Nm,"
                     "torque_y_Nm,torque_z_Nm,tissue_Nm\n";
  for (const TickRecord& tick : ticks) {
    if (!tick.second)
      continue;
    const SecondHandRecord& hand = *tick.second;
    const Vector3& x = hand.device.position;
    text += fmt::format("{},{:.6g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:d},{:.6g},{:.6g},{:.6g},"
                        "{:.6g}\n",
                        hand.device.tick, hand.device.time, x.x(), x.y(), x.z(), hand.force.x(), hand.force.y(),
                        hand.force.z(), hand.tissue.norm(), hand.energy, hand.limited, hand.torque.x(), hand.torque.y(),
                        hand.torque.z(), hand.tissue_torque.norm());
    if (text.size() > 1'000'000) {
      out.write(text);
      text.clear();
    }
  }
  out.write(text);
  out.close();
}

void write_solves(const std::filesystem::path& file, const std::vector<SolveRecord>& solves) {
  OutputFile out(file);
  std::string text =
      "sequence,pose_tick,arrival_tick,degradation,failed,resprinkled,force_jump,cut_triangles,nodes,"
      "candidates,active,asymmetry,force_N,cut_area_m2,blade_N,edge_N,release_J_m2,edge_pieces,work_J,surface_J,"
      "crushing_J,friction_J,excess_J,stored_J,update,residual,swapped,seconds,torque_Nm,blade_Nm\n";
  for (const SolveRecord& solve : solves)
    text +=
        fmt::format("{},{},{},{},{:d},{:d},{:.3g},{},{},{},{},{:.3g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{},{:.6g},{:."
                    "6g},{:.6g},{:.6g},{:.6g},{:.6g},{},{},"
                    "{:d},{:"
                    ".6g},{:.6g},{:.6g}\n",
                    solve.event.sequence, solve.event.pose_tick,
                    solve.event.arrival_tick == SolveEvent::never ? "" : fmt::format("{}", solve.event.arrival_tick),
                    solve.event.degradation, solve.failed, solve.resprinkled, solve.force_jump, solve.cut_triangles,
                    solve.nodes, solve.candidates, solve.active, solve.asymmetry, solve.force.norm(), solve.cut_area,
                    solve.blade_force.norm(), solve.blade_edge, solve.blade_release, solve.blade_contacts,
                    solve.blade_account.work, solve.blade_account.surface, solve.blade_account.crushing,
                    solve.blade_account.friction, solve.blade_account.excess, solve.blade_account.stored, solve.update,
                    solve.residual > 0 ? fmt::format("{:.2g}", solve.residual) : "", solve.event.swaps, solve.seconds,
                    solve.torque.norm(), solve.blade_torque.norm());
  out.write(text);
  out.close();
}

// Bins that double from 1 us on.
void write_deadlines(const std::filesystem::path& file, const std::vector<TickRecord>& ticks) {
  constexpr int bins = 24;
  std::array<long, bins> latency{};
  std::array<long, bins> compute{};
  const auto bin = [](double seconds) {
    return seconds < 1e-6 ? 0 : std::min(bins - 1, 1 + static_cast<int>(std::floor(std::log2(us * seconds))));
  };
  for (const TickRecord& tick : ticks) {
    ++latency[static_cast<std::size_t>(bin(tick.latency))];
    ++compute[static_cast<std::size_t>(bin(tick.compute))];
  }
  Table table({"below_us", "latency_ticks", "compute_ticks"});
  for (int b = 0; b < bins; ++b)
    table.add({std::exp2(b), static_cast<double>(latency[static_cast<std::size_t>(b)]),
               static_cast<double>(compute[static_cast<std::size_t>(b)])});
  table.write(file);
}

std::string rate_text(const PaceCounters& pace, double ticks) {
  if (pace.rate <= 0)
    return "";
  std::string text = fmt::format("  the last client sent {:.0f} poses a second, the least {:.0f}\n", pace.rate,
                                 pace.slowest > 0 ? pace.slowest : pace.rate);
  if (pace.interpolated > 0)
    text += fmt::format("  {:.3g} s with the pose interpolated, as late as the time between two of the client's\n",
                        static_cast<double>(pace.interpolated) / ticks);
  if (pace.faded > 0)
    text += fmt::format("  {:.3g} s without force: {}\n", static_cast<double>(pace.faded) / ticks,
                        too_slow_text(pace.slowest));
  return text;
}

void add_pace(nlohmann::json& json, const PaceCounters& pace) {
  json["client_rate"] = pace.rate;
  json["slowest_client_rate"] = pace.slowest;
  json["interpolated_ticks"] = pace.interpolated;
  json["faded_ticks"] = pace.faded;
  json["faded_because"] = pace.faded > 0 ? too_slow_text(pace.slowest) : "";
}

} // namespace

std::string too_slow_text(double rate) {
  return fmt::format("a client of {:.3g} poses a second; allowed: {:g} or more, fewer cannot keep the hand steady",
                     rate, slowest_client);
}

std::string pace_text(const PaceReading& pace, const std::string& client) {
  switch (pace.kind) {
  case PaceKind::full:
    return fmt::format("{} sends {:.0f} poses a second", client, pace.rate);
  case PaceKind::interpolated:
    return fmt::format("{} sends {:.0f} poses a second; its pose is interpolated, {:.2g} ms late", client, pace.rate,
                       1e3 / pace.rate);
  case PaceKind::too_slow:
    return client.substr(0, client.find(':')) + ": the force fades: " + too_slow_text(pace.rate);
  case PaceKind::unknown:
    break;
  }
  return "bridge: nobody holds the tool";
}

std::string link_text(HaplyLink link, const HaplySettings& settings) {
  switch (link) {
  case HaplyLink::streams:
    break;
  case HaplyLink::silent:
    return fmt::format("haply: no pose for {:g} s: the force goes to zero", settings.timeout);
  case HaplyLink::no_device:
    return "haply: the service has the Inverse3 no more: the force goes to zero";
  case HaplyLink::gone:
    return fmt::format("haply: the service at {} has gone: the force goes to zero; it is looked for again",
                       settings.address);
  }
  return "haply: the Inverse3 is back; the tool goes on from where it is";
}

Percentiles percentiles(std::vector<double> samples) {
  if (samples.empty())
    return {};
  std::sort(samples.begin(), samples.end());
  const auto at = [&](double share) {
    const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(samples.size())));
    return samples[std::clamp<std::size_t>(rank, 1, samples.size()) - 1];
  };
  return {at(0.5), at(0.99), at(0.999), samples.back()};
}

ForceSteps force_steps(const LoopRecords& records) {
  ForceSteps steps;
  std::vector<char> cut(records.ticks.size(), 0);
  for (const SolveRecord& solve : records.solves)
    if (solve.cut_triangles > 0 && solve.event.arrival_tick < records.ticks.size())
      cut[solve.event.arrival_tick] = 1;
  for (std::size_t i = 1; i < records.ticks.size(); ++i) {
    const TickRecord& now = records.ticks[i];
    const TickRecord& before = records.ticks[i - 1];
    const double step = (now.force - before.force).norm();
    steps.any = std::max(steps.any, step);
    if (now.arrived)
      steps.hand_over = std::max(steps.hand_over, step);
    if ((now.active > 0) != (before.active > 0))
      steps.onset = std::max(steps.onset, step);
    if (cut[i] != 0)
      steps.cut = std::max(steps.cut, step);
  }
  return steps;
}

ModelError model_error(const std::vector<TickRecord>& ticks, const std::vector<SolvedForce>& solved) {
  ModelError error;
  double sum = 0;
  for (const SolvedForce& truth : solved) {
    if (truth.tick >= ticks.size())
      break;
    error.peak = std::max(error.peak, truth.force.norm());
    const Vector3& felt = ticks[truth.tick].tissue;
    if (truth.force.norm() == 0 && felt.norm() == 0)
      continue;
    const double off = (felt - truth.force).norm();
    error.largest = std::max(error.largest, off);
    sum += off * off;
    ++error.ticks;
  }
  error.rms = error.ticks > 0 ? std::sqrt(sum / static_cast<double>(error.ticks)) : 0;
  return error;
}

namespace {

SecondHandFindings second_findings(const std::vector<TickRecord>& ticks) {
  SecondHandFindings found;
  const SecondHandRecord* before = nullptr;
  for (const TickRecord& tick : ticks) {
    const SecondHandRecord* now = tick.second ? &*tick.second : nullptr;
    if (now != nullptr) {
      ++found.ticks;
      found.peak = std::max(found.peak, now->force.norm());
      found.peak_torque = std::max(found.peak_torque, now->torque.norm());
      found.energy = now->energy;
      found.lowest_energy = std::min(found.lowest_energy, now->energy);
      found.limited += now->limited ? 1 : 0;
      if (before != nullptr)
        found.step = std::max(found.step, (now->force - before->force).norm());
    }
    before = now;
  }
  return found;
}

nlohmann::json json_of(const BridgeCounters& bridge) {
  nlohmann::json json = {{"poses", bridge.poses},  {"clients", bridge.clients}, {"silent", bridge.lost},
                         {"old", bridge.old},      {"garbage", bridge.garbage}, {"others", bridge.others},
                         {"unsent", bridge.unsent}};
  add_pace(json, bridge);
  return json;
}

nlohmann::json json_of(const HaplyCounters& haply) {
  nlohmann::json json = {{"messages", haply.messages},
                         {"garbage", haply.garbage},
                         {"poses", haply.poses},
                         {"silent", haply.lost},
                         {"connected_again", haply.renewed}};
  add_pace(json, haply);
  return json;
}

/// `hand`: before each line.
std::string text_of(const std::string& hand, const std::optional<BridgeCounters>& bridge,
                    const std::optional<HaplyCounters>& haply, double tick_rate) {
  std::string text;
  if (bridge)
    text += fmt::format("{}bridge: {} poses of {} clients, {} of them fell silent; {} packets too old, {} garbage, {} "
                        "of others; {} forces unsent\n",
                        hand, bridge->poses, bridge->clients, bridge->lost, bridge->old, bridge->garbage,
                        bridge->others, bridge->unsent) +
            rate_text(*bridge, tick_rate);
  if (haply)
    text += fmt::format("{}haply: {} messages of the service, {} of them garbage; {} poses taken; {} times silent, "
                        "connected again {} times\n",
                        hand, haply->messages, haply->garbage, haply->poses, haply->lost, haply->renewed) +
            rate_text(*haply, tick_rate);
  return text;
}

} // namespace

HapticFindings findings_of(const HapticSettings& settings, const LoopRecords& records, const RealtimeReport& report) {
  HapticFindings findings;
  findings.loop = report;
  findings.tick_rate = settings.rate;
  std::vector<double> latency;
  std::vector<double> compute;
  std::vector<double> solve;
  for (const TickRecord& tick : records.ticks) {
    latency.push_back(tick.latency);
    compute.push_back(tick.compute);
    findings.peak = std::max(findings.peak, tick.force.norm());
    findings.peak_torque = std::max(findings.peak_torque, tick.torque.norm());
    findings.lowest_energy = std::min(findings.lowest_energy, tick.energy);
    findings.outside += tick.outside ? 1 : 0;
    findings.unconverged += tick.converged ? 0 : 1;
    findings.limited += tick.limited ? 1 : 0;
    findings.softened += tick.softened < 1 ? 1 : 0;
  }
  for (const SolveRecord& record : records.solves) {
    findings.failed += record.failed ? 1 : 0;
    findings.resprinkled += record.resprinkled ? 1 : 0;
    findings.resprinkle_jump = std::max(findings.resprinkle_jump, record.force_jump);
    findings.swaps += record.event.swaps ? 1 : 0;
    findings.increments += record.cut_triangles > 0 ? 1 : 0;
    findings.blade_peak = std::max(findings.blade_peak, record.blade_force.norm());
    findings.blade_peak_torque = std::max(findings.blade_peak_torque, record.blade_torque.norm());
    if (!record.failed) {
      findings.blade_account = record.blade_account;
      findings.cut_area = record.cut_area;
    }
    findings.highest_degradation = std::max(findings.highest_degradation, record.event.degradation);
    if (!record.failed)
      solve.push_back(record.seconds);
  }
  const double seconds = static_cast<double>(records.ticks.size()) / settings.rate;
  const double wall = report.seconds > 0 ? report.seconds : seconds;
  findings.rate = static_cast<double>(records.ticks.size()) / wall;
  findings.solve_rate = static_cast<double>(records.solves.size()) / wall;
  findings.latency = percentiles(std::move(latency));
  findings.compute = percentiles(std::move(compute));
  findings.solve = percentiles(std::move(solve));
  findings.steps = force_steps(records);
  findings.energy = records.ticks.empty() ? 0 : records.ticks.back().energy;
  findings.second = second_findings(records.ticks);
  return findings;
}

std::string text_of(const HapticFindings& f) {
  const bool has_clock = f.loop.seconds > 0; // in virtual time a tick has neither lateness nor duration
  std::string text;
  if (has_clock)
    text = fmt::format("haptic loop: {:.1f} ticks/s, {} overruns, {}\n  wake latency {}\n  compute time {}\n"
                       "simulation: {:.1f} solves/s, ",
                       f.rate, f.loop.overruns, f.loop.fifo ? "SCHED_FIFO, spinning" : "plain scheduling",
                       line_of(f.latency), line_of(f.compute), f.solve_rate);
  else
    text = fmt::format(
        "haptic loop in virtual time: {:g} ticks and {:.4g} solves a second of it\nsimulation: a solve took ", f.rate,
        f.solve_rate);
  text += fmt::format(
      "p50 {:.2f}, p99 {:.2f}, max {:.1f} ms; {} cut increments, {} re-sprinkles{}, {} failed, coarsened to "
      "level {}{}\n",
      1e3 * f.solve.p50, 1e3 * f.solve.p99, 1e3 * f.solve.largest, f.increments, f.resprinkled,
      f.resprinkle_jump > 0 ? fmt::format(" (of the force by up to {:.2g} %)", 100 * f.resprinkle_jump) : "", f.failed,
      f.highest_degradation,
      f.highest_degradation > 0 ? fmt::format(" (rebuilds missed their budget: nodes up to {:.2g} "
                                              "times as far apart)",
                                              std::pow(coarse_per_level, f.highest_degradation))
                                : "");
  text += fmt::format("force: peak {:.4g} N; largest step in a tick {:.3g} N (at hand-overs {:.3g}, onset {:.3g}, cut "
                      "increments {:.3g} N)\n",
                      f.peak, f.steps.any, f.steps.hand_over, f.steps.onset, f.steps.cut);
  text += fmt::format("  torque: peak {:.4g} mN m\n", 1e3 * f.peak_torque);
  text += fmt::format("  {} ticks limited, {} softened, {} with the contact beyond the patch, {} not converged\n",
                      f.limited, f.softened, f.outside, f.unconverged);
  if (f.blade_account.work > 0)
    text += fmt::format("blade: peak {:.4g} N, {:.4g} mN m; {}\n", f.blade_peak, 1e3 * f.blade_peak_torque,
                        account_text(f.blade_account));
  if (f.increments > 0)
    text += fmt::format("cut: {:.4g} cm2{}\n", 1e4 * f.cut_area,
                        f.unfollowed ? "; the body had yet to follow the blade's last way" : "");
  if (f.error.ticks > 0)
    text += fmt::format("  against the solved force at {} ticks: RMS {:.3g} N = {:.2f} % of the peak {:.4g} N, largest "
                        "{:.3g} N\n",
                        f.error.ticks, f.error.rms, f.error.peak > 0 ? 100 * f.error.rms / f.error.peak : 0.0,
                        f.error.peak, f.error.largest);
  text += fmt::format("energy at the port: {:.3g} J put in by the hand, lowest {:.3g} J\n", f.energy, f.lowest_energy);
  text += text_of("", f.bridge, f.haply, f.tick_rate);
  if (f.second.ticks > 0)
    text += fmt::format("second hand, with the blade: {} ticks; force: peak {:.4g} N, largest step in a tick {:.3g} N; "
                        "torque: peak {:.4g} mN m; {} ticks limited; {:.3g} J put in, lowest {:.3g} J\n",
                        f.second.ticks, f.second.peak, f.second.step, 1e3 * f.second.peak_torque, f.second.limited,
                        f.second.energy, f.second.lowest_energy);
  text += text_of("second hand: ", f.second.bridge, f.second.haply, f.tick_rate);
  if (has_clock)
    text += fmt::format("time: ticks {:.3g} s, solves {:.3g} s, {} frames {:.3g} s, of {:.3g} s; {:.3g} s to prepare",
                        f.loop.haptic_cpu_seconds, f.loop.solve_seconds, f.loop.frames, f.loop.viewer_seconds,
                        f.loop.seconds, f.loop.prepare_seconds);
  else
    text.pop_back(); // the end of its last line
  return text;
}

void write_haptics(const std::filesystem::path& folder, const LoopRecords& records, const HapticFindings& findings,
                   const std::vector<SolvedForce>& solved) {
  write_ticks(folder / "haptic_ticks.csv", records, solved);
  if (findings.second.ticks > 0)
    write_second(folder / "haptic_second.csv", records.ticks);
  write_solves(folder / "haptic_solves.csv", records.solves);
  write_deadlines(folder / "haptic_deadlines.csv", records.ticks);
  const HapticFindings& f = findings;
  nlohmann::json json{
      {"ticks", records.ticks.size()},
      {"interrupted", f.loop.stopped},
      {"ticks_per_second", f.rate},
      {"overruns", f.loop.overruns},
      {"unrecorded", f.loop.lost},
      {"sched_fifo", f.loop.fifo},
      {"latency_s", json_of(f.latency)},
      {"compute_s", json_of(f.compute)},
      {"solves_per_second", f.solve_rate},
      {"solve_s", json_of(f.solve)},
      {"failed_solves", f.failed},
      {"cut_increments", f.increments},
      {"resprinkles", f.resprinkled},
      {"largest_resprinkle_jump", f.resprinkle_jump},
      {"background_swaps", f.swaps},
      {"highest_degradation", f.highest_degradation},
      {"peak_force_N", f.peak},
      {"peak_torque_Nm", f.peak_torque},
      {"largest_step_N",
       {{"any", f.steps.any}, {"hand_over", f.steps.hand_over}, {"onset", f.steps.onset}, {"cut", f.steps.cut}}},
      {"model_error_N",
       {{"rms", f.error.rms}, {"largest", f.error.largest}, {"solved_peak", f.error.peak}, {"ticks", f.error.ticks}}},
      {"port_energy_J", {{"end", f.energy}, {"lowest", f.lowest_energy}}},
      {"blade", {{"peak_N", f.blade_peak}, {"peak_Nm", f.blade_peak_torque}}},
      {"cut_area_m2", f.cut_area},
      {"cut_unfollowed", f.unfollowed},
      {"ticks_limited", f.limited},
      {"ticks_softened", f.softened},
      {"ticks_outside", f.outside},
      {"ticks_unconverged", f.unconverged},
      {"seconds",
       {{"prepare", f.loop.prepare_seconds},
        {"session", f.loop.seconds},
        {"ticks", f.loop.haptic_cpu_seconds},
        {"solves", f.loop.solve_seconds},
        {"frames", f.loop.viewer_seconds}}}};
  for (const AccountEntry& entry : account_of(f.blade_account))
    json["blade"][entry.key] = entry.joules;
  if (f.bridge)
    json["bridge"] = json_of(*f.bridge);
  if (f.haply)
    json["haply"] = json_of(*f.haply);
  if (f.second.ticks > 0)
    json["second_hand"] = {{"ticks", f.second.ticks},
                           {"peak_force_N", f.second.peak},
                           {"peak_torque_Nm", f.second.peak_torque},
                           {"largest_step_N", f.second.step},
                           {"port_energy_J", {{"end", f.second.energy}, {"lowest", f.second.lowest_energy}}},
                           {"ticks_limited", f.second.limited}};
  if (f.second.bridge)
    json["second_hand"]["bridge"] = json_of(*f.second.bridge);
  if (f.second.haply)
    json["second_hand"]["haply"] = json_of(*f.second.haply);
  replace_file(folder / "haptic.json", json.dump(2) + "\n");
}

} // namespace spherecut::app
