#include "src/scenario/scenario.hpp"

#include "src/scenario/cut_reader.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/scenario/region_reader.hpp"
#include "src/scenario/tear_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/files/label_volume.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double on_the_plane = 1e-9; // m, so that rounding does not lose the nodes of a face that bounds a region

std::string text_of(const Vector3& v) {
  return fmt::format("[{:g}, {:g}, {:g}]", v.x(), v.y(), v.z());
}

OrganSettings organ(const Section& section, const std::filesystem::path& scenario, Offences& offences) {
  OrganSettings organ;
  const std::string shape = section.text("shape");
  if (shape == "block") {
    organ.shape = BlockOrgan{section.vector("size")};
  } else if (shape == "cylinder") {
    organ.shape = CylinderOrgan{section.number("radius"), section.number("height")};
  } else if (shape == "hemisphere") {
    organ.shape = HemisphereOrgan{section.number("radius")};
  } else if (shape == "liver") {
    organ.shape = LiverOrgan{static_cast<int>(section.integer("triangles"))};
  } else {
    const std::filesystem::path file = scenario.parent_path() / section.text("file");
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(file, ignored))
      offences.add(section.line("file"),
                   fmt::format("organ.file = \"{}\": {} {}", section.text("file"),
                               std::filesystem::exists(file, ignored) ? "this is no file, but a folder or a device:"
                                                                      : "there is no file",
                               file.lexically_normal().string()));
    FileOrgan from_file{file, section.optional_number("scale").value_or(0), std::nullopt, {}};
    if (const auto label = section.optional_integer("label"))
      from_file.label = static_cast<int>(*label);
    const std::string pieces = section.text("pieces"), cavities = section.text("cavities");
    using topology::CavityChoice;
    using topology::PieceChoice;
    from_file.choices.pieces = pieces == "largest" ? PieceChoice::largest
                               : pieces == "all"   ? PieceChoice::all
                                                   : PieceChoice::refuse;
    from_file.choices.cavities = cavities == "fill"     ? CavityChoice::fill
                                 : cavities == "refuse" ? CavityChoice::refuse
                                                        : CavityChoice::keep;
    if (from_file.label && !topology::is_label_volume(file))
      offences.add(section.line("label"),
                   fmt::format("organ.label = {}: {} is a surface, which has no labels; allowed: "
                               "with a label volume (.nrrd, .nii, .nii.gz, .mha)",
                               *from_file.label, section.text("file")));
    organ.shape = from_file;
  }
  organ.edge = section.optional_number("edge").value_or(0);
  organ.voxel_size = section.optional_number("voxel_size").value_or(0);
  return organ;
}

FixedRegion fixed_region(const Section& section, std::size_t number, Offences& offences) {
  FixedRegion region;
  region.line = static_cast<int>(section.line());
  region.name = section.text("name");
  if (region.name.empty())
    region.name = fmt::format("{}", number);
  region.components = section.axes("axes");
  const std::string kind = section.text("region");
  if (kind == "box") {
    const BoxRegion box{section.vector("lower"), section.vector("upper")};
    if ((box.lower.array() > box.upper.array()).any())
      offences.add(section.line("lower"), fmt::format("fixed[{}].lower = {} m: above upper = {} m; allowed: lower <= "
                                                      "upper in every coordinate",
                                                      number, text_of(box.lower), text_of(box.upper)));
    region.shape = box;
  } else if (kind == "sphere") {
    region.shape = SphereRegion{section.vector("centre"), section.number("radius")};
  } else {
    const Vector3 normal = direction(section, fmt::format("fixed[{}].normal", number), "normal", offences);
    region.shape = Plane{normal, normal.dot(section.vector("point"))};
  }
  return region;
}

NodeSettings nodes(const Section& section, Offences& offences) {
  NodeSettings nodes;
  nodes.fine_spacing = section.optional_number("fine_spacing").value_or(0);
  nodes.coarse_spacing = section.optional_number("coarse_spacing").value_or(0);
  nodes.slope = section.number("slope");
  nodes.fine_radius = section.optional_number("fine_radius").value_or(0);
  nodes.count = static_cast<int>(section.optional_integer("count").value_or(0));
  nodes.random_seed = static_cast<std::uint64_t>(section.integer("random_seed"));
  if (nodes.fine_spacing > 0 && nodes.coarse_spacing > 0 && nodes.coarse_spacing < nodes.fine_spacing)
    offences.add(section.line("coarse_spacing"),
                 fmt::format("nodes.coarse_spacing = {:g} m: below fine_spacing; allowed: at least {:g} m",
                             nodes.coarse_spacing, nodes.fine_spacing));
  return nodes;
}

topology::ToolShape tool_shape(const Section& section, Offences& offences) {
  const std::string shape = section.text("shape");
  if (shape == "sphere_tip" || shape == "grasper")
    return topology::SphereTip{section.number("radius")};
  if (shape == "flat_punch")
    return topology::FlatPunch{section.number("radius"), section.number("length")};
  if (shape != "laparoscope")
    throw InputError(fmt::format("tool.shape = \"{}\": the program has no such tool", shape));
  const topology::Laparoscope tool{section.number("tip_radius"), section.number("shaft_radius"),
                                   section.number("shaft_length"), section.vector("port")};
  if (tool.shaft_radius > tool.tip_radius)
    offences.add(section.line("shaft_radius"),
                 fmt::format("tool.shaft_radius = {:g} m: thicker than the tip; allowed: at most tip_radius = {:g} m",
                             tool.shaft_radius, tool.tip_radius));
  return tool;
}

std::vector<PathPoint> tool_path(const Section& tool, Offences& offences) {
  std::vector<PathPoint> path;
  for (const Section& section : tool.tables("path")) {
    const PathPoint point{section.number("time"), section.vector("position"),
                          static_cast<int>(section.line("position"))};
    if (!path.empty() && point.time <= path.back().time)
      offences.add(section.line("time"), fmt::format("tool.path[{}].time = {:g} s: not after the pose before it; "
                                                     "allowed: above {:g} s",
                                                     path.size() + 1, point.time, path.back().time));
    path.push_back(point);
  }
  if (path.size() < 2)
    offences.add(tool.line("path"), fmt::format("tool.path has {} pose; allowed: two or more", path.size()));
  return path;
}

Approach approach(const Section& section, const ToolSettings& tool, Offences& offences) {
  Approach approach;
  approach.target = section.vector("target");
  approach.direction = direction(section, "tool.approach.direction", "direction", offences);
  approach.depth = section.number("depth");
  approach.clearance = section.number("clearance");
  approach.duration = section.number("duration");
  approach.line = static_cast<int>(section.line());
  Vector3 axis = tool.axis;
  if (const auto* laparoscope = std::get_if<topology::Laparoscope>(&tool.shape))
    axis = laparoscope->port - approach.target;
  const bool has_directions = !approach.direction.isZero(0) && !tool.axis.isZero(0); // else that has been told
  if (has_directions && approach.direction.dot(axis) >= 0)
    offences.add(section.line("direction"),
                 fmt::format("tool.approach.direction = {}: moves the tool backwards; allowed: more than 90 degrees "
                             "from its axis {}",
                             text_of(approach.direction), text_of(axis.normalized())));
  return approach;
}

/// When a grasper holds, checked against its path.
GraspSettings grasp(const Section& section, const std::vector<PathPoint>& path, Offences& offences) {
  GraspSettings grasp;
  if (path.empty())
    return grasp;
  const double start = path.front().time, end = path.back().time;
  grasp.grasp = section.optional_number("grasp").value_or(start);
  if (const auto release = section.optional_number("release"))
    grasp.release = *release;
  if (grasp.grasp < start || grasp.grasp > end)
    offences.add(section.line("grasp"),
                 fmt::format("tool.grasp = {:g} s: not on its path; allowed: {:g} to {:g} s", grasp.grasp, start, end));
  if (grasp.release <= grasp.grasp)
    offences.add(section.line("release"), fmt::format("tool.release = {:g} s: not after it takes hold; allowed: above "
                                                      "{:g} s",
                                                      grasp.release, grasp.grasp));
  return grasp;
}

ToolSettings tool(const Section& section, Offences& offences) {
  ToolSettings tool;
  tool.line = static_cast<int>(section.line());
  tool.shape = tool_shape(section, offences);
  if (!std::holds_alternative<topology::Laparoscope>(tool.shape))
    tool.axis = direction(section, "tool.axis", "axis", offences);
  tool.step = section.optional_number("step").value_or(0);
  if (section.has("approach") == section.has("path")) {
    offences.add(section.line(),
                 fmt::format("tool has {} approach {} path; allowed: one of the two",
                             section.has("approach") ? "both" : "neither", section.has("approach") ? "and" : "nor"));
    return tool;
  }
  const bool grasper = section.text("shape") == "grasper";
  if (grasper && section.has("approach")) {
    offences.add(section.line("approach"), "tool.approach: a grasper presses on nothing; allowed: tool.path");
    return tool;
  }
  double duration = 0;
  if (section.has("approach")) {
    tool.motion = approach(section.table("approach"), tool, offences);
    duration = std::get<Approach>(tool.motion).duration;
  } else {
    tool.motion = tool_path(section, offences);
    const auto& path = std::get<std::vector<PathPoint>>(tool.motion);
    duration = path.empty() ? 0 : path.back().time - path.front().time;
    if (grasper)
      tool.grasp = grasp(section, path, offences);
  }
  if (duration > 0 && tool.step > 0 && (tool.step > duration || duration / tool.step > static_cast<double>(most_steps)))
    offences.add(section.line("step"),
                 fmt::format("tool.step = {:g} s: allowed for a motion of {:g} s: {:g} to {:g} s", tool.step, duration,
                             duration / static_cast<double>(most_steps), duration));
  return tool;
}

HeldDevice held_device(const std::string& name) {
  if (name == "script")
    return HeldDevice::script;
  if (name == "recording")
    return HeldDevice::recording;
  if (name == "haply")
    return HeldDevice::haply;
  if (name == "bridge")
    return HeldDevice::bridge;
  if (name == "hand")
    return HeldDevice::hand;
  throw InputError(fmt::format("haptics.device = \"{}\": the program has no such device", name));
}

/// `path`: of the section, for errors.
HaplySettings haply(const Section& section, const char* path, Offences& offences) {
  HaplySettings haply{section.text("address"), section.text("device_id"), section.number("timeout")};
  if (!websocket_address(haply.address))
    offences.add(
        section.line("address"),
        fmt::format("{}.address = \"{}\": allowed: ws://HOST:PORT, as in ws://localhost:10001", path, haply.address));
  return haply;
}

BridgeSettings bridge(const Section& section) {
  return {section.text("address"), static_cast<int>(section.integer("port")), section.number("timeout")};
}

/// Two devices of one hand each: they cannot be the same one.
SecondDevice second_device(const Section& section, const HapticSettings& first, Offences& offences) {
  if (first.device == HeldDevice::recording)
    offences.add(section.line(), "haptics.second beside haptics.device = \"recording\": a recording of two hands moves "
                                 "both; allowed: one of the two");
  SecondDevice second{held_device(section.text("device")), bridge(section.table("bridge")),
                      haply(section.table("haply"), "haptics.second.haply", offences)};
  if (second.device == HeldDevice::bridge && first.device == HeldDevice::bridge && second.bridge.port != 0 &&
      second.bridge.port == first.bridge.port)
    offences.add(section.line("device"),
                 fmt::format("haptics.second.bridge.port = {}: that of the first hand, too; allowed: another one",
                             second.bridge.port));
  if (second.device == HeldDevice::haply && first.device == HeldDevice::haply &&
      (second.haply.device_id.empty() || second.haply.device_id == first.haply.device_id))
    offences.add(section.line("device"),
                 fmt::format("haptics.second.haply.device_id = \"{}\": which of two Inverse3 is in which hand is not "
                             "known; allowed: a device_id for each hand, two different ones",
                             second.haply.device_id));
  return second;
}

HapticSettings haptics(const Section& section, const std::filesystem::path& scenario, Offences& offences) {
  HapticSettings haptics;
  haptics.rate = section.number("rate");
  haptics.model = force_model_from_string(section.text("model"));
  haptics.hand_over = section.number("hand_over");
  haptics.budget = section.number("budget");
  haptics.passivity = section.boolean("passivity");
  haptics.viewer_rate = section.number("viewer_rate");
  haptics.device = held_device(section.text("device"));
  if (section.has("recording"))
    haptics.recording = scenario.parent_path() / section.text("recording");
  else if (haptics.device == HeldDevice::recording)
    offences.add(section.line("device"), "haptics.device = \"recording\": which one is missing; allowed: beside "
                                         "haptics.recording = \"FILE\"");
  haptics.bridge = bridge(section.table("bridge"));
  haptics.haply = haply(section.table("haply"), "haptics.haply", offences);
  const Section limits = section.table("limits");
  haptics.limits = {limits.number("gain"),       limits.number("force"),
                    limits.number("slew"),       limits.number("torque"),
                    limits.number("stiffness"),  limits.number("damping"),
                    limits.number("resolution"), static_cast<int>(limits.integer("delay"))};
  const Section hand = section.table("hand");
  haptics.hand = {hand.number("mass"),       hand.number("stiffness"), hand.number("damping"),
                  haptics.limits.resolution, haptics.limits.delay,     true};
  if (section.has("second"))
    haptics.second = second_device(section.table("second"), haptics, offences);
  return haptics;
}

} // namespace

bool FixedRegion::holds(const Vector3& x) const {
  if (const auto* box = std::get_if<BoxRegion>(&shape))
    return (x.array() >= box->lower.array() - on_the_plane).all() &&
           (x.array() <= box->upper.array() + on_the_plane).all();
  if (const auto* sphere = std::get_if<SphereRegion>(&shape))
    return (x - sphere->centre).norm() <= sphere->radius + on_the_plane;
  return std::get<Plane>(shape).signed_distance(x) <= on_the_plane;
}

namespace {

/// What a blade's force needs, and what needs a blade's force.
void check_blade_force(const Scenario& scenario, const Section& root, Offences& offences) {
  const Section section = root.table("blade");
  const BladeSettings& blade = *scenario.blade;
  const bool resists = scenario.toughness > 0;
  for (const char* key : {"sharpness", "friction"})
    if (!resists && section.has(key))
      offences.add(section.line(key),
                   fmt::format("blade.{} is given, but nothing resists the blade: material.toughness is left out; "
                               "allowed: both or neither",
                               key));
  if (resists && blade.advance.value_or(0) > 0)
    offences.add(
        section.line("advance"),
        fmt::format("blade.advance = {:g} with material.toughness = {:g} J/m2: a resisted blade cuts as far as "
                    "its work goes; allowed: one of them",
                    *blade.advance, scenario.toughness));
  if (blade.friction > 0 && blade.flank == 0)
    offences.add(section.line("friction"), fmt::format("blade.friction = {:g} Pa on flanks of no extent; allowed: with "
                                                       "blade.flank above 0 m",
                                                       blade.friction));
  if (resists && scenario.method.method == solvers::Method::published)
    offences.add(root.table("material").line("toughness"),
                 fmt::format("material.toughness = {:g} J/m2: the force of a blade is in newtons, which method.name = "
                             "\"published\" does not have; allowed: with galerkin or collocation",
                             scenario.toughness));
}

/// What tearing needs.
void check_tearing(const Scenario& scenario, const Section& root, Offences& offences) {
  const Section section = root.table("tearing");
  if (!scenario.layers.empty() && scenario.toughness == 0)
    offences.add(root.table("material").line("layer"), "material.layer without material.toughness, which holds "
                                                       "elsewhere; allowed: both or neither");
  if (!scenario.tearing.enabled)
    return;
  if (scenario.toughness == 0)
    offences.add(section.line(), "tearing without material.toughness; allowed: with a toughness above 0 J/m2");
  if (scenario.method.method == solvers::Method::published)
    offences.add(section.line(), "tearing weighs energies, which method.name = \"published\" does not have; allowed: "
                                 "with galerkin or collocation");
  if (scenario.precuts.empty() && !scenario.blade && scenario.tearing.strength == 0)
    offences.add(section.line(), "tearing: there is no precut and no blade, and without tearing.strength no tear "
                                 "starts by itself; allowed: one of them or more");
}

Scenario scenario_of(const ScenarioDocument& document, const std::filesystem::path& file) {
  const Section& root = document.root();
  Offences offences(file.string());
  Scenario scenario;
  scenario.file = file;
  scenario.text = document.text();
  scenario.title = root.text("title");
  scenario.organ = organ(root.table("organ"), file, offences);
  const Section material = root.table("material");
  scenario.law = material_law(material, offences);
  scenario.material = {material.has("young_modulus") ? material.number("young_modulus")
                                                     : solvers::small_strain_moduli(scenario.law.spec).young_modulus(),
                       material.number("poisson_ratio"), material.number("density")};
  scenario.regions = material_regions(material, file, scenario.material, offences);
  scenario.toughness = material.optional_number("toughness").value_or(0);
  for (const Section& section : material.tables("layer"))
    scenario.layers.push_back(toughness_layer(section, scenario.layers.size() + 1, offences));
  if (root.has("tearing"))
    scenario.tearing = tearing(root.table("tearing"));
  for (const Section& section : root.tables("fixed"))
    scenario.fixed.push_back(fixed_region(section, scenario.fixed.size() + 1, offences));
  if (scenario.fixed.empty())
    offences.add(root.line("fixed"),
                 "fixed = []: nothing is fixed, the organ would float; allowed: one region or more");
  for (std::size_t axis = 0; axis < 3 && !scenario.fixed.empty(); ++axis)
    if (std::none_of(scenario.fixed.begin(), scenario.fixed.end(),
                     [&](const FixedRegion& region) { return region.components[axis]; }))
      offences.add(scenario.fixed.front().line,
                   fmt::format("fixed[].axes: no region holds {}, the organ would float along it; allowed: every axis "
                               "in one region at least",
                               "xyz"[axis]));
  scenario.nodes = nodes(root.table("nodes"), offences);
  const Section method = root.table("method");
  scenario.method.method = solvers::method_from_string(method.text("name"));
  scenario.method.support_radius = method.optional_number("support_radius").value_or(0);
  scenario.method.quadrature = static_cast<int>(method.integer("quadrature"));
  if (root.has("gravity"))
    scenario.gravity = root.table("gravity").vector("acceleration");
  scenario.pretension = material.strain("pretension");
  if (root.has("tool"))
    scenario.tool = tool(root.table("tool"), offences);
  const Section contact = root.table("contact");
  if (const std::string condition = contact.text("condition"); condition == "bonded") {
    scenario.contact.condition = solvers::ContactCondition::bonded;
  } else if (condition == "frictional") {
    scenario.contact.condition = solvers::ContactCondition::frictional;
    scenario.contact.friction = contact.number("friction");
  }
  scenario.contact.candidate_radius = contact.optional_number("candidate_radius").value_or(0);
  scenario.contact.follow_fraction = contact.number("follow_fraction");
  for (const Section& section : root.tables("precut"))
    scenario.precuts.push_back(precut(section, file, scenario.precuts.size() + 1, offences));
  scenario.cut = cut(root.table("cut"));
  if (scenario.cut.sight == solvers::SightRule::appended && scenario.method.method != solvers::Method::galerkin)
    offences.add(
        root.table("cut").line("sight"),
        fmt::format("cut.sight = \"appended\" with method.name = \"{}\"; allowed: with galerkin, or visibility, "
                    "diffraction, enriched",
                    solvers::to_string(scenario.method.method)));
  if (root.has("blade"))
    scenario.blade = blade(root.table("blade"), offences);
  if (scenario.blade)
    check_blade_force(scenario, root, offences);
  check_tearing(scenario, root, offences);
  check_regions(scenario, offences);
  scenario.method.cut_ahead = scenario.blade || !scenario.precuts.empty();
  if (!scenario.tool && !scenario.blade && scenario.precuts.empty() && !scenario.tearing.enabled && !scenario.gravity &&
      scenario.pretension.isZero())
    offences.add(1, "there is no tool, no blade, no precut and no load (gravity, material.pretension): nothing to "
                    "compute; allowed: one of them or more");
  scenario.haptics = haptics(root.table("haptics"), file, offences);
  if (scenario.haptics.second && (!scenario.tool || !scenario.blade))
    offences.add(root.table("haptics").table("second").line(),
                 fmt::format("haptics.second: a second hand holds the blade beside the tool in the first, and there is "
                             "no {}; allowed: with [tool] and [blade]",
                             scenario.tool ? "[blade]" : "[tool]"));
  const Section output = root.table("output");
  scenario.output = {static_cast<int>(output.integer("vtp_every")), output.boolean("figures")};
  offences.throw_if_any();
  return scenario;
}

} // namespace

Scenario read_scenario(const std::filesystem::path& file) {
  return scenario_of(ScenarioDocument(file), file);
}

Scenario read_scenario_text(const std::filesystem::path& file, std::string text) {
  return scenario_of(ScenarioDocument(file, std::move(text)), file);
}

} // namespace spherecut::app
