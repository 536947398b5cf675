#include "src/live/bench.hpp"

#include "src/base/output_file.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace spherecut::app {
namespace {

// A block of 60 mm with its top at 30 mm.
std::string block(double modulus, double fine_spacing) {
  return fmt::format(R"([organ]
shape = "block"
size = [0.06, 0.06, 0.03]
[material]
young_modulus = {:.1f}
poisson_ratio = 0.3
TOUGHNESS
[[fixed]]
region = "box"
lower = [-1, -1, -0.001]
upper = [1, 1, 0.001]
[nodes]
fine_spacing = {:.4f}
coarse_spacing = 0.012
)",
                     modulus, fine_spacing);
}

std::string replaced_word(std::string text, const std::string& word, const std::string& value) {
  return text.replace(text.find(word), word.size(), value);
}

constexpr const char* punch = R"([tool]
shape = "flat_punch"
radius = 0.005
length = 0.03
step = 0.1
[tool.approach]
target = [0.0, 0.0, 0.03]
direction = [0.0, 0.0, -1.0]
depth = 0.001
clearance = 0.001
duration = 1.0
)";
constexpr const char* ball = R"([contact]
condition = "frictional"
friction = 0.3
[tool]
shape = "sphere_tip"
radius = 0.006
step = 0.1
[[tool.path]]
time = 0.0
position = [-0.01, 0.0, 0.031]
[[tool.path]]
time = 1.0
position = [-0.01, 0.0, 0.030]
)";
constexpr const char* edge = R"([cut]
front_spacing = 0.004
[blade]
edge = [[0, -0.04, 0], [0, 0.04, 0]]
step = 0.1
[[blade.path]]
time = 0.0
position = [0.004, 0.0, 0.032]
[[blade.path]]
time = 1.0
position = [0.004, 0.0, 0.010]
)";

Scenario scene(const std::string& text, const HapticSettings& settings) {
  Scenario scenario = read_scenario_text("bench.toml", text);
  scenario.haptics = settings;
  return scenario;
}

PathPose pose(double time, double x, double z) {
  return {time, {x, 0, z}, Eigen::Quaterniond::Identity()};
}

nlohmann::json json_of(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

std::string cell(const std::optional<double>& value, double scale) {
  return value ? fmt::format("{:.3g}", scale * *value) : "-";
}

} // namespace

std::vector<Manoeuvre> bench_manoeuvres(const HapticSettings& settings) {
  const std::string stiff = replaced_word(block(100000, 0.005), "TOUGHNESS", "") + punch;
  const std::string soft = replaced_word(block(10000, 0.004), "TOUGHNESS", "") + ball;
  const std::string tough = replaced_word(block(10000, 0.006), "TOUGHNESS", "toughness = 10.0") + edge;
  return {{"press",
           "push the tool into the stiff block by 4 mm at once, and hold it there",
           scene(stiff, settings),
           {pose(0.2, 0, 0.031), pose(0.25, 0, 0.026)},
           1.5},
          {"tap",
           "tap on the stiff block once",
           scene(stiff, settings),
           {pose(0.2, 0, 0.031), pose(0.25, 0, 0.028), pose(0.3, 0, 0.031)},
           0.8,
           false},
          {"slide",
           "press the ball into the block by 3 mm and slide it evenly over the block by 20 mm",
           scene(soft, settings),
           {pose(0.1, -0.01, 0.031), pose(0.4, -0.01, 0.026), pose(1.6, 0.01, 0.026)},
           1.6},
          {"cut",
           "bring the blade down evenly, 20 mm in a second",
           scene(tough, settings),
           {pose(0.1, 0.004, 0.032), pose(1.1, 0.004, 0.010)},
           1.1}};
}

BenchSeries bench_series(const HapticSettings& settings, const LoopRecords& records) {
  BenchSeries series;
  series.rate = settings.rate;
  series.delay = settings.limits.delay;
  for (const TickRecord& tick : records.ticks) {
    series.positions.push_back(tick.device.position);
    series.forces.push_back(tick.force);
  }
  return series;
}

std::string bench_table(const std::vector<BenchResult>& results) {
  std::string text = fmt::format("{:<6} {:>9} {:>8} {:>9} {:>11} {:>15} {:>12} {:>11}\n", "", "settled N", "peak N",
                                 "rise ms", "overshoot %", "oscillation mN", "injected mJ", "jerk m/s3");
  for (const auto& [name, f] : results)
    text += fmt::format("{:<6} {:>9} {:>8} {:>9} {:>11} {:>15} {:>12} {:>11}\n", name, cell(f.settled, 1),
                        cell(f.peak, 1), cell(f.rise, 1e3), cell(f.overshoot, 100), cell(f.oscillation, 1e3),
                        cell(f.injected, 1e3), cell(f.jerk, 1));
  text.pop_back();
  return text;
}

void write_bench(const std::filesystem::path& folder, const HapticSettings& settings,
                 const std::vector<BenchResult>& results) {
  nlohmann::ordered_json json;
  json["device"] = device_name(settings.device);
  json["ticks_per_second"] = settings.rate;
  json["model"] = to_string(settings.model);
  json["passivity"] = settings.passivity;
  const DeviceLimits& limits = settings.limits;
  json["limits"] = {{"gain", limits.gain},
                    {"force_N", limits.force},
                    {"slew_N_per_s", limits.slew},
                    {"stiffness_N_per_m", limits.stiffness},
                    {"damping_N_s_per_m", limits.damping},
                    {"resolution_m", limits.resolution},
                    {"delay_ticks", limits.delay}};
  for (const auto& [name, f] : results)
    json["manoeuvres"][name] = {{"settled_N", json_of(f.settled)},
                                {"peak_N", f.peak},
                                {"rise_s", json_of(f.rise)},
                                {"overshoot", json_of(f.overshoot)},
                                {"oscillation_N", json_of(f.oscillation)},
                                {"injected_J", f.injected},
                                {"jerk_m_per_s3", json_of(f.jerk)}};
  replace_file(folder / "haptic_bench.json", json.dump(2) + "\n");
}

} // namespace spherecut::app
