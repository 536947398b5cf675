#include "experiments/support/plane_slits.hpp"

#include "experiments/support/precut_series.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/tilted_strip.hpp"

#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <map>
#include <sstream>

namespace spherecut::experiments {

namespace {

using Eigen::Vector2d;

constexpr double plate_width = 2, plate_thickness = 0.3; // m

std::vector<double> slit_numbers(const std::string& text, char between) {
  std::vector<double> numbers;
  std::istringstream cells(text);
  for (std::string cell; std::getline(cells, cell, between);) {
    char* end = nullptr;
    numbers.push_back(std::strtod(cell.c_str(), &end));
    if (cell.empty() || end != cell.c_str() + cell.size())
      throw InputError(fmt::format("table of slits: '{}' is not a number", cell));
  }
  return numbers;
}

Vector2d direction(const PlaneSlits& plate, const PlaneSlits::Place& place) {
  const std::vector<Vector2d>& corners = plate.slits[place.slit];
  return (corners[place.part + 1] - corners[place.part]).normalized();
}

Vector2d left_of(const Vector2d& way) {
  return {-way.y(), way.x()};
}

Vector2d point_of(const PlaneSlits& plate, const PlaneSlits::Place& place) {
  const std::vector<Vector2d>& corners = plate.slits[place.slit];
  return corners[place.part] + place.share * (corners[place.part + 1] - corners[place.part]);
}

/// Through the whole thickness and beyond; corners of the slit are edges of the sheet, its + side is on the left.
topology::SurfaceMesh slit_sheet(const CutFrame& frame, const std::vector<Vector2d>& corners, double edge) {
  std::vector<Vector2d> along{corners.front()};
  for (std::size_t k = 1; k < corners.size(); ++k) {
    const Vector2d way = corners[k] - corners[k - 1];
    const int steps = static_cast<int>(std::ceil(way.norm() / edge));
    for (int step = 1; step <= steps; ++step)
      along.emplace_back(corners[k - 1] + way * step / steps);
  }
  constexpr double width = 1.6 * plate_thickness;
  const int across = static_cast<int>(std::ceil(width / edge));
  topology::SurfaceMesh sheet;
  for (const Vector2d& x : along)
    for (int j = 0; j <= across; ++j)
      sheet.vertices.push_back(frame.origin + frame.global({x[0], x[1], width * (1.0 * j / across - 0.5)}));
  const auto vertex = [across](int i, int j) { return i * (across + 1) + j; };
  for (int i = 0; i + 1 < std::ssize(along); ++i)
    for (int j = 0; j < across; ++j) {
      sheet.triangles.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1)});
      sheet.triangles.push_back({vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
    }
  topology::split_bridges(sheet);
  return sheet;
}

} // namespace

// Comment lines "# key: value", one header line, then slit,part,share,calculix_x,calculix_y,getfem_x,getfem_y.
PlaneSlits read_plane_slits(std::string_view table) {
  PlaneSlits plate;
  std::map<std::string, std::vector<double>> told;
  std::istringstream lines{std::string(table)};
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# ")) {
      const std::size_t colon = line.find(": ");
      const std::string key = line.substr(2, colon - 2);
      if (key != "made by" && key != "source")
        told[key] = slit_numbers(line.substr(colon + 2), ' ');
      continue;
    }
    if (line.empty() || line.starts_with("slit,"))
      continue;
    const std::vector<double> row = slit_numbers(line, ',');
    if (row.size() != 7)
      throw InputError(fmt::format("table of slits: line '{}' (must have seven columns)", line));
    plate.places.push_back(
        {static_cast<int>(row[0]), static_cast<int>(row[1]), row[2], {row[3], row[4]}, {row[5], row[6]}});
  }
  const auto of = [&told](const std::string& key, std::size_t size) -> const std::vector<double>& {
    const auto found = told.find(key);
    if (found == told.end() || (size > 0 && found->second.size() != size))
      throw InputError(fmt::format("table of slits: no line '# {}: ...' with as many numbers as it needs", key));
    return found->second;
  };
  plate.tension = {of("tension", 2)[0], of("tension", 2)[1]};
  plate.poisson_ratio = of("poisson_ratio", 1)[0];
  plate.mesh_change = std::max(of("calculix_change", 1)[0], of("getfem_change", 1)[0]);
  plate.codes_apart = of("codes_apart", 1)[0];
  for (int slit = 0; told.contains(fmt::format("slit_{}", slit)); ++slit) {
    const std::vector<double>& numbers = of(fmt::format("slit_{}", slit), 0);
    plate.slits.emplace_back();
    for (std::size_t k = 0; k + 1 < numbers.size(); k += 2)
      plate.slits.back().emplace_back(numbers[k], numbers[k + 1]);
  }
  for (const PlaneSlits::Place& place : plate.places)
    if (place.slit < 0 || place.slit >= std::ssize(plate.slits) || place.part < 0 ||
        place.part + 1 >= std::ssize(plate.slits[place.slit]))
      throw InputError(
          fmt::format("table of slits: a place on part {} of slit {}, which is not there", place.part, place.slit));
  return plate;
}

namespace {

/// One plate on one node set.
struct SlitRun {
  int nodes = 0;
  std::vector<std::array<Vector2d, 3>> openings; // m, of every place: three across the thickness, the middle in between
};

constexpr std::array<double, 3> across_thickness{-0.25, 0, 0.25}; // of it

SlitRun run_slits(const PlaneSlits& plate, const PrecutMethod& method, Placement placement, double fine, int seed) {
  const TiltedStrip strip =
      tilted_strip(plate_width, plate_width, plate_thickness, 0.2, StripSides::sliding, placement);
  const CutFrame& frame = strip.frame;
  CutBodyCase cut;
  cut.domain = strip.domain;
  for (const std::vector<Vector2d>& corners : plate.slits)
    cut.sheets.push_back(slit_sheet(frame, corners, 0.06));
  cut.fine = fine;
  cut.method = method.method;
  cut.sight = method.sight;
  cut.seed = static_cast<std::uint64_t>(seed);
  CutBody body = cut_body(cut);
  body.problem.material = {1, plate.poisson_ratio, 0};
  hold_strip(body.problem, strip);
  body.problem.loads.traction = [frame, tension = plate.tension](const Vector3&, const Vector3& n) -> Vector3 {
    for (int axis = 0; axis < 2; ++axis) {
      const Vector3& pulled = axis == 0 ? frame.ahead : frame.normal;
      if (const double side = n.dot(pulled); std::abs(side) > 0.9)
        return (side > 0 ? tension[axis] : -tension[axis]) * pulled;
    }
    return Vector3::Zero();
  };
  const auto discretisation = solvers::discretise(body.problem, method.options());
  const solvers::Field field = discretisation->solve();
  SlitRun run{body.problem.nodes.size(), {}};
  for (const PlaneSlits::Place& place : plate.places) {
    const Vector2d left = left_of(direction(plate, place)), at = point_of(plate, place);
    run.openings.emplace_back();
    for (std::size_t k = 0; k < across_thickness.size(); ++k) {
      const Vector3 x = frame.origin + frame.global({at[0], at[1], across_thickness[k] * plate_thickness});
      const Vector3 jump = opening_at(*discretisation, field, x, frame.global({left[0], left[1], 0}), body.fine);
      run.openings.back()[k] = {jump.dot(frame.ahead), jump.dot(frame.normal)};
    }
  }
  return run;
}

std::string opening_key(const PlaneSlits& plate, std::size_t slit) {
  return plate.slits.size() > 1 ? fmt::format("opening_{}", slit + 1) : "opening";
}

/// Openings across the slits by the elements and by one run, in the middle of the thickness.
app::Figure opening_figure(const PlaneSlits& plate, const SlitRun& run, const std::string& title) {
  app::Figure figure{title, "way along the slit / m", "opening across the slit / m", false, false, {}};
  for (int slit = 0; slit < std::ssize(plate.slits); ++slit) {
    const std::string which = plate.slits.size() > 1 ? fmt::format(", slit {}", slit + 1) : "";
    app::Series exact{"finite elements" + which, {}, {}, app::SeriesStyle::lines};
    app::Series found{"finite spheres" + which, {}, {}, app::SeriesStyle::points};
    for (std::size_t k = 0; k < plate.places.size(); ++k) {
      const PlaneSlits::Place& place = plate.places[k];
      if (place.slit != slit)
        continue;
      const std::vector<Vector2d>& corners = plate.slits[slit];
      const Vector2d left = left_of(direction(plate, place));
      double way = (point_of(plate, place) - corners[place.part]).norm();
      for (int part = 0; part < place.part; ++part)
        way += (corners[part + 1] - corners[part]).norm();
      for (app::Series* series : {&exact, &found})
        series->x.push_back(way);
      exact.y.push_back(place.opening.dot(left));
      found.y.push_back(run.openings[k][1].dot(left));
    }
    figure.series.push_back(exact);
    figure.series.push_back(found);
  }
  return figure;
}

} // namespace

std::vector<Check> run_plane_slits(const ExperimentContext& context, const std::string& name, const std::string& title,
                                   const PlaneSlits& plate, double bound) {
  const int seeds = context.quick ? 1 : 10;
  const std::vector<double> spacings = context.quick ? std::vector<double>{0.06} : std::vector<double>{0.04, 0.025};
  std::vector<double> largest(plate.slits.size(), 0); // openings, m
  for (const PlaneSlits::Place& place : plate.places)
    largest[place.slit] = std::max(largest[place.slit], place.opening.norm());
  std::vector<Check> checks;
  app::Table table({"placement", "method", "spacing", "seed", "nodes", "slit", "part", "share", "z", "opening_across",
                    "opening_along", "reference_across", "reference_along"});
  struct Run {
    PrecutMethod method;
    Placement placement;
    bool is_default; // the first method is
  };
  std::vector<Run> runs;
  for (const Placement placement : precut_placements(context.quick))
    for (const PrecutMethod& method : precut_methods(true, true))
      runs.push_back({method, placement, method.name() == precut_methods(true, true).front().name()});
  for (const auto& [method, placement, is_default] : runs) {
    const bool is_judged = is_default || (!context.quick && method.sight == solvers::SightRule::appended);
    if (placement == Placement::aligned && !is_judged)
      continue;
    for (const double fine : placement == Placement::tilted ? spacings : std::vector<double>{spacings.back()}) {
      ErrorSeries errors;
      int nodes = 0;
      for (int seed = 1; seed <= seeds; ++seed) {
        const SlitRun run = run_slits(plate, method, placement, fine, seed);
        nodes = run.nodes;
        std::vector<double> worst(plate.slits.size(), 0);
        for (std::size_t k = 0; k < plate.places.size(); ++k) {
          const PlaneSlits::Place& place = plate.places[k];
          const Vector2d way = direction(plate, place), left = left_of(way);
          for (std::size_t z = 0; z < across_thickness.size(); ++z) {
            const Vector2d& opening = run.openings[k][z];
            worst[place.slit] = std::max(worst[place.slit], (opening - place.opening).norm() / largest[place.slit]);
            table.add({to_string(placement), method.name(), fmt::format("{:g}", fine), fmt::format("{}", seed),
                       fmt::format("{}", nodes), fmt::format("{}", place.slit + 1), fmt::format("{}", place.part + 1),
                       fmt::format("{:g}", place.share), fmt::format("{:g}", across_thickness[z] * plate_thickness),
                       fmt::format("{:.6g}", opening.dot(left)), fmt::format("{:.6g}", opening.dot(way)),
                       fmt::format("{:.6g}", place.opening.dot(left)), fmt::format("{:.6g}", place.opening.dot(way))});
          }
        }
        for (std::size_t slit = 0; slit < plate.slits.size(); ++slit)
          errors.add(opening_key(plate, slit), worst[slit]);
        if (is_default && seed == 1 && fine == spacings.back() && placement == Placement::tilted)
          app::write_png(opening_figure(plate, run, title), context.out / "openings.png");
      }
      context.say(fmt::format("{}{}, {} m apart, about {} nodes, medians (worst): {}", method.name(), suffix(placement),
                              fine, nodes, errors.text()));
      const std::string prefix = fmt::format("{}_{}{}_{:g}_mm", name, method.name(), suffix(placement), 1000 * fine);
      for (std::size_t slit = 0; slit < plate.slits.size(); ++slit)
        if (const std::string key = opening_key(plate, slit); is_judged)
          errors.check(prefix, key, bound, checks);
        else
          checks.push_back({fmt::format("{}_{}_reported", prefix, key), median(errors[key]), ">=", 0});
    }
  }
  // The reference is to be known better than what is asked of the method.
  checks.push_back({name + "_reference_meshes", plate.mesh_change, "<=", 0.005});
  checks.push_back({name + "_reference_codes", plate.codes_apart, "<=", 0.005});
  table.write(context.out / "openings.csv");
  return checks;
}

} // namespace spherecut::experiments
