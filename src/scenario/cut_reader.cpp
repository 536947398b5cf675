#include "src/scenario/cut_reader.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double shortest_edge = 1e-6; // m

RectangleSheet rectangle(const Section& section, const std::string& name, Offences& offences) {
  RectangleSheet sheet{section.vector("centre"), direction(section, name + ".normal", "normal", offences),
                       direction(section, name + ".up", "up", offences), section.number("width"),
                       section.number("height")};
  const Vector3 across = sheet.up - sheet.up.dot(sheet.normal) * sheet.normal;
  if (across.norm() > 1e-6)
    sheet.up = across.normalized();
  else if (!sheet.up.isZero(0)) // else that has been told
    offences.add(section.line("up"), name + ".up: lies along the normal; allowed: any other direction");
  return sheet;
}

/// Between two poses a blade turns by the shorter way. Where it goes half way round or more about one axis, poses in
/// between tell which way that is.
std::vector<BladePoint> with_half_turns(const std::vector<BladePoint>& path) {
  constexpr double most = 90; // degrees from one pose to the next
  std::vector<BladePoint> all;
  for (const BladePoint& to : path) {
    if (!all.empty()) {
      const BladePoint from = all.back();
      const Vector3 turn = to.rotation - from.rotation;
      const bool one_axis = from.rotation.cross(to.rotation).norm() <= 1e-9 * from.rotation.norm() * to.rotation.norm();
      const int parts = one_axis && turn.norm() >= 180 ? static_cast<int>(std::ceil(turn.norm() / most)) : 1;
      for (int k = 1; k < parts; ++k) {
        const double share = static_cast<double>(k) / parts;
        all.push_back({from.time + share * (to.time - from.time), from.position + share * (to.position - from.position),
                       from.rotation + share * turn});
      }
    }
    all.push_back(to);
  }
  return all;
}

std::vector<BladePoint> blade_path(const Section& blade, Offences& offences) {
  std::vector<BladePoint> path;
  for (const Section& section : blade.tables("path")) {
    const BladePoint point{section.number("time"), section.vector("position"), section.vector("rotation")};
    if (!path.empty() && point.time <= path.back().time)
      offences.add(section.line("time"), fmt::format("blade.path[{}].time = {:g} s: not after the pose before it; "
                                                     "allowed: above {:g} s",
                                                     path.size() + 1, point.time, path.back().time));
    path.push_back(point);
  }
  if (path.size() < 2)
    offences.add(blade.line("path"), fmt::format("blade.path has {} pose{}; allowed: two or more", path.size(),
                                                 path.size() == 1 ? "" : "s"));
  return with_half_turns(path);
}

} // namespace

PrecutSettings precut(const Section& section, const std::filesystem::path& scenario, std::size_t number,
                      Offences& offences) {
  const std::string name = fmt::format("precut[{}]", number);
  PrecutSettings precut;
  precut.line = static_cast<int>(section.line());
  precut.pressure = section.number("pressure");
  const std::string shape = section.text("shape");
  if (shape == "disc") {
    precut.shape = DiscSheet{section.vector("centre"), direction(section, name + ".normal", "normal", offences),
                             section.number("radius")};
  } else if (shape == "rectangle") {
    precut.shape = rectangle(section, name, offences);
  } else if (shape == "polygon") {
    const PolygonSheet polygon{section.points("points")};
    if (polygon.points.size() < 3)
      offences.add(section.line("points"),
                   fmt::format("{}.points has {} corners; allowed: three or more", name, polygon.points.size()));
    precut.shape = polygon;
  } else {
    const std::filesystem::path file = scenario.parent_path() / section.text("file");
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(file, ignored))
      offences.add(section.line("file"), fmt::format("{}.file = \"{}\": there is no file {}", name,
                                                     section.text("file"), file.lexically_normal().string()));
    precut.shape = SheetFile{file, section.number("scale")};
  }
  return precut;
}

CutSettings cut(const Section& section) {
  CutSettings cut;
  if (section.has("sight"))
    cut.sight = solvers::sight_rule_from_string(section.text("sight"));
  cut.lips = solvers::lip_condition_from_string(section.text("lips"));
  cut.unheld = solvers::unheld_pieces_from_string(section.text("unheld"));
  cut.front_spacing = section.optional_number("front_spacing").value_or(0);
  return cut;
}

BladeSettings blade(const Section& section, Offences& offences) {
  BladeSettings blade;
  blade.line = static_cast<int>(section.line());
  blade.edge = section.points("edge");
  if (blade.edge.size() < 2)
    offences.add(section.line("edge"), fmt::format("blade.edge has {} point{}: no edge; allowed: two or more",
                                                   blade.edge.size(), blade.edge.size() == 1 ? "" : "s"));
  for (std::size_t i = 1; i < blade.edge.size(); ++i)
    if ((blade.edge[i] - blade.edge[i - 1]).norm() < shortest_edge)
      offences.add(section.line("edge"),
                   fmt::format("blade.edge: points {} and {} are {:.2g} m apart; allowed: at "
                               "least {:g} m",
                               i, i + 1, (blade.edge[i] - blade.edge[i - 1]).norm(), shortest_edge));
  blade.edge_radius = section.number("edge_radius");
  blade.sharpness = section.number("sharpness");
  blade.friction = section.number("friction");
  blade.flank = section.number("flank");
  blade.step = section.optional_number("step").value_or(0);
  blade.advance = section.optional_number("advance");
  blade.path = blade_path(section, offences);
  const double duration = blade.path.empty() ? 0 : blade.path.back().time - blade.path.front().time;
  if (duration > 0 && blade.step > 0 &&
      (blade.step > duration || duration / blade.step > static_cast<double>(most_steps)))
    offences.add(section.line("step"),
                 fmt::format("blade.step = {:g} s: allowed for a motion of {:g} s: {:g} to {:g} s", blade.step,
                             duration, duration / static_cast<double>(most_steps), duration));
  return blade;
}

} // namespace spherecut::app
