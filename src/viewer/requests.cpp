#include "src/viewer/requests.hpp"

#include "src/scenario/keys.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace spherecut::app {
namespace {

using Json = nlohmann::json;

constexpr std::array<std::pair<RequestType, std::string_view>, 15> request_names{{
    {RequestType::hello, "hello"},
    {RequestType::credit, "credit"},
    {RequestType::take, "take"},
    {RequestType::release, "release"},
    {RequestType::mode, "mode"},
    {RequestType::pose, "pose"},
    {RequestType::park, "park"},
    {RequestType::second, "second"},
    {RequestType::grip, "grip"},
    {RequestType::reset, "reset"},
    {RequestType::scenario, "scenario"},
    {RequestType::set, "set"},
    {RequestType::overlays, "overlays"},
    {RequestType::record, "record"},
    {RequestType::replay, "replay"},
}};

constexpr std::array<std::pair<HandMode, std::string_view>, 3> mode_names{
    {{HandMode::probe, "probe"}, {HandMode::blade, "blade"}, {HandMode::grasper, "grasper"}}};

constexpr double most_coordinate = 1e3; // m

[[noreturn]] void refuse(const std::string& text) {
  throw InputError(text);
}

const Json& field(const Json& message, const char* name) {
  const auto found = message.find(name);
  if (found == message.end())
    refuse(fmt::format("'{}' is missing", name));
  return *found;
}

double number_of(const Json& value, const char* name) {
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    refuse(fmt::format("'{}' must be a finite number", name));
  return value.get<double>();
}

bool flag_of(const Json& value, const char* name) {
  if (!value.is_boolean())
    refuse(fmt::format("'{}' must be true or false", name));
  return value.get<bool>();
}

std::string text_of(const Json& value, const char* name) {
  if (!value.is_string() || value.get_ref<const std::string&>().size() > 255)
    refuse(fmt::format("'{}' must be a text of at most 255 bytes", name));
  return value.get<std::string>();
}

int whole_of(const Json& value, const char* name, long long least, long long most) {
  if (!value.is_number_integer() || value.get<long long>() < least || value.get<long long>() > most)
    refuse(fmt::format("'{}' must be a whole number from {} to {}", name, least, most));
  return value.get<int>();
}

template <int size>
Eigen::Matrix<double, size, 1> numbers_of(const Json& value, const char* name, double most) {
  Eigen::Matrix<double, size, 1> numbers;
  if (!value.is_array() || value.size() != static_cast<std::size_t>(size))
    refuse(fmt::format("'{}' must be {} numbers", name, size));
  for (int i = 0; i < size; ++i) {
    numbers[i] = number_of(value[static_cast<std::size_t>(i)], name);
    if (std::abs(numbers[i]) > most)
      refuse(fmt::format("'{}' must be at most {:g}", name, most));
  }
  return numbers;
}

HandMode mode_of(const Json& value) {
  const std::string text = text_of(value, "mode");
  for (const auto& [mode, name] : mode_names)
    if (name == text)
      return mode;
  refuse("'mode' must be probe, blade or grasper");
}

SettingsChange settings_of(const Json& message) {
  SettingsChange change;
  std::size_t known = 1; // the type
  const auto has = [&](const char* name) {
    known += message.contains(name) ? 1 : 0;
    return message.contains(name);
  };
  const auto number = [&](const char* name, std::optional<double>& value) {
    if (has(name))
      value = number_of(message[name], name);
  };
  number("young_modulus", change.young_modulus);
  number("poisson_ratio", change.poisson_ratio);
  number("toughness", change.toughness);
  number("fine_spacing", change.fine_spacing);
  number("coarse_spacing", change.coarse_spacing);
  if (has("method"))
    change.method = solvers::method_from_string(text_of(message["method"], "method"));
  if (has("sight"))
    change.sight = solvers::sight_rule_from_string(text_of(message["sight"], "sight"));
  if (known == 1 || known < message.size()) // a session is not begun anew, its cuts lost, by a name that is mistyped
    refuse("'set' must name one or more of young_modulus, poisson_ratio, toughness, fine_spacing, coarse_spacing, "
           "method and sight, and nothing else");
  return change;
}

ViewerRequest::Pick pick_of(const Json& value) {
  ViewerRequest::Pick pick;
  if (value.is_number())
    pick.node = whole_of(value, "pick", 0, 1'000'000'000);
  else
    pick.place = numbers_of<3>(value, "pick", most_coordinate);
  return pick;
}

ViewerRequest::Slice slice_of(const Json& value) {
  if (!value.is_object())
    refuse("'slice' must be an object or null");
  ViewerRequest::Slice slice;
  slice.point = numbers_of<3>(field(value, "point"), "slice.point", most_coordinate);
  slice.normal = numbers_of<3>(field(value, "normal"), "slice.normal", most_coordinate);
  if (!(slice.normal.norm() > 1e-9))
    refuse("'slice.normal' must not be zero");
  slice.normal.normalize();
  slice.size = number_of(field(value, "size"), "slice.size");
  if (!(slice.size > 0) || slice.size > most_coordinate)
    refuse("'slice.size' must be above 0");
  if (value.contains("count"))
    slice.count = whole_of(value["count"], "slice.count", 2, 256);
  return slice;
}

OverlaysChange overlays_of(const Json& message) {
  OverlaysChange change;
  if (message.contains("colour")) {
    const std::string name = text_of(message["colour"], "colour");
    if (name == "none")
      change.colour = Overlays::Colour::none;
    else if (name == "displacement")
      change.colour = Overlays::Colour::displacement;
    else if (name == "von_mises")
      change.colour = Overlays::Colour::von_mises;
    else
      refuse("'colour' must be none, displacement or von_mises");
  }
  if (message.contains("nodes"))
    change.nodes = flag_of(message["nodes"], "nodes");
  if (message.contains("stages"))
    change.stages = flag_of(message["stages"], "stages");
  if (message.contains("pick"))
    change.pick = message["pick"].is_null() ? std::nullopt : std::optional(pick_of(message["pick"]));
  if (message.contains("slice"))
    change.slice = message["slice"].is_null() ? std::nullopt : std::optional(slice_of(message["slice"]));
  return change;
}

/// Which hand a message is about; the first, where it does not say.
WhichHand hand_of(const Json& message) {
  return message.contains("hand") && whole_of(message["hand"], "hand", 1, 2) == 2 ? WhichHand::second
                                                                                  : WhichHand::first;
}

void read_pose(const Json& message, Request& request) {
  request.hand = hand_of(message);
  const Json& number = field(message, "n");
  if (!number.is_number_unsigned() || number.get<std::uint64_t>() > 0xffffffffU)
    refuse("'n' must be a whole number from 0 to 4294967295");
  request.pose = number.get<std::uint32_t>();
  request.position = numbers_of<3>(field(message, "position"), "position", most_coordinate);
  if (!message.contains("orientation"))
    return;
  const auto turn = numbers_of<4>(message["orientation"], "orientation", most_coordinate);
  if (!(turn.norm() > 1e-6))
    refuse("'orientation' must not be zero");
  request.orientation = Eigen::Quaterniond(turn[3], turn[0], turn[1], turn[2]).normalized();
}

void check_key(const char* path, double value) {
  const ScenarioKey* key = find_scenario_key(path);
  if (key != nullptr && !key->range.holds(value))
    refuse(fmt::format("{} = {:g} {}: allowed: {}", path, value, key->unit, allowed_values(*key)));
}

} // namespace

std::string_view to_string(RequestType type) {
  for (const auto& [value, name] : request_names)
    if (value == type)
      return name;
  return "unknown";
}

bool needs_tool(RequestType type) {
  return type != RequestType::hello && type != RequestType::credit && type != RequestType::take &&
         type != RequestType::overlays;
}

Request parse_request(std::string_view text) {
  const Json message = Json::parse(text, nullptr, false);
  if (!message.is_object())
    refuse("a message must be a JSON object");
  const std::string type = text_of(field(message, "type"), "type");
  const auto* const named =
      std::find_if(request_names.begin(), request_names.end(), [&](const auto& entry) { return entry.second == type; });
  if (named == request_names.end())
    refuse("the type of the message is not known");
  Request request;
  request.type = named->first;
  switch (request.type) {
  case RequestType::hello:
    request.number = whole_of(field(message, "version"), "version", 0, 1'000'000);
    break;
  case RequestType::credit:
    request.number = whole_of(field(message, "frames"), "frames", 1, 8);
    break;
  case RequestType::mode:
    request.mode = mode_of(field(message, "mode"));
    break;
  case RequestType::pose:
    read_pose(message, request);
    break;
  case RequestType::park:
    request.hand = hand_of(message);
    break;
  case RequestType::second:
    request.on = flag_of(field(message, "on"), "on");
    break;
  case RequestType::grip:
    request.on = flag_of(field(message, "closed"), "closed");
    break;
  case RequestType::record:
    request.on = flag_of(field(message, "on"), "on");
    break;
  case RequestType::scenario:
    request.name = text_of(field(message, "name"), "name");
    break;
  case RequestType::replay:
    if (!field(message, "name").is_null())
      request.name = text_of(message["name"], "name");
    break;
  case RequestType::set:
    request.settings = settings_of(message);
    break;
  case RequestType::overlays:
    request.overlays = overlays_of(message);
    break;
  case RequestType::take:
  case RequestType::release:
  case RequestType::reset:
    break;
  }
  return request;
}

void apply(const SettingsChange& change, Scenario& scenario) {
  const auto put = [](const char* path, const std::optional<double>& value, double& place) {
    if (!value)
      return;
    check_key(path, *value);
    place = *value;
  };
  put("material.young_modulus", change.young_modulus, scenario.material.young_modulus);
  put("material.poisson_ratio", change.poisson_ratio, scenario.material.poisson_ratio);
  if (auto* linear = std::get_if<solvers::LinearLaw>(&scenario.law.spec.law)) { // no other law has a session
    linear->shear_modulus = scenario.material.shear_modulus();
    scenario.law.spec.bulk_modulus =
        solvers::bulk_modulus_of(scenario.material.shear_modulus(), scenario.material.poisson_ratio);
  }
  put("nodes.fine_spacing", change.fine_spacing, scenario.nodes.fine_spacing);
  put("nodes.coarse_spacing", change.coarse_spacing, scenario.nodes.coarse_spacing);
  if (change.toughness && *change.toughness == 0)
    scenario.toughness = 0; // nothing resists the blade
  else
    put("material.toughness", change.toughness, scenario.toughness);
  if (change.method)
    scenario.method.method = *change.method;
  if (change.sight)
    scenario.cut.sight = *change.sight;
  if (scenario.cut.sight == solvers::SightRule::appended && scenario.method.method != solvers::Method::galerkin) {
    if (change.sight)
      throw InputError(fmt::format("sight 'appended' with method '{}'; allowed: with galerkin, or visibility, "
                                   "diffraction, enriched",
                                   solvers::to_string(scenario.method.method)));
    scenario.cut.sight.reset(); // the method's own
  }
}

} // namespace spherecut::app
